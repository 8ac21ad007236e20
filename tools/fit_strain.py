"""Try values of the strain scene's fitted settings, and compare one statistic each with the recorded strain sensors.

The settings of SET_BY were fitted by hand, all together, to the statistics of reports/twins. Each of them stands here
beside the statistic that says most about what the setting means (pipeline/scenes/strain.py); the statistics were named
after a run that showed which of them each setting moves. For the present value and for others around it, with
all other settings as they are and with the same seeds, the scene runs the recorded program; the median over its
specimens is compared with the recorded median. A setting is told by its statistic if the values tried change the
statistic by more than the recorded range is wide; else the recordings allow all of them. A value that is not the
nearest is no error: other statistics hold it, and notes of reports/twins say which.

Nothing is changed: write the value you choose into params/strain.yaml.
"""

import argparse
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pandas as pd
from tqdm import tqdm

from pipeline.stability import changed_scene
from pipeline.twins import strain as twins
from tactile.base import arguments, params
from tactile.base.availability import why_not_run
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.drawing import markdown
from tools.calibrate import changes_of

FACTORS = (0.7, 1.4)  # times the present value, which is tried, too
SET_BY = {  # key below strain.simulate -> one of twins.STATISTICS
    "strand.sensitivity_per_mm": "response",
    "strand.fast_share": "rest_over_response",
    "strand.fast_time_s": "rest_memory_near",
    "strand.slow_share": "drift_over_response",
    "strand.slow_time_s": "rest_memory_far",
    "strand.break_spread": "effective_rank",
    "strand.break_time_s": "rest_memory_near",
    "drift.wander": "drift_over_response",
    "drift.wander_time_s": "drift_growth",
    "drift.ageing": "time_share",
    "drift.ageing_time_s": "time_share",
    "circuit.noise_v": "noise",
}


class Tried(NamedTuple):
    """A setting, the values tried, the first of which is the present one, and the statistic at each of them."""

    setting: str
    values: list[float]
    simulated: list[float]
    recorded: tuple[float, float, float]  # median, lowest, highest

    def nearest(self) -> float:
        """Return the value whose statistic is nearest to the recorded median."""
        miss = [abs(value - self.recorded[0]) for value in self.simulated]
        return self.values[miss.index(min(miss))]

    def told(self) -> bool:
        """Return whether the values change the statistic by more than the recorded range is wide."""
        _, low, high = self.recorded
        return max(self.simulated) - min(self.simulated) > high - low


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add factors and specimens to the parser of this command."""
    parser.add_argument("--factors", nargs="+", type=float, default=FACTORS, help="times the present value (0.7 1.4)")
    parser.add_argument("--specimens", type=int, help="fingers per value (as many as the scene has; 0.6 s each)")


def medians(table: pd.DataFrame) -> pd.Series:
    """Return statistic -> median over recordings."""
    return table.groupby("statistic")["value"].median()


def simulated(values: Mapping, specimens: int, setting: str = "", value: float = 0.0) -> pd.Series:
    """Return statistic -> median over specimens of the scene, with one setting at `value`; "": none is changed."""
    changes = {"simulate": {"specimens": specimens}}
    if setting:
        changes["simulate"] |= changes_of(setting, value)
    where = f"{setting} = {value:g}" if setting else f"{specimens} specimens"
    settings = changed_scene.settings_of(values, "strain", changes, where)
    return medians(twins.simulated(None, {**values, "strain": settings}))


def tried(values: Mapping, recorded: pd.DataFrame, factors: Sequence[float], specimens: int) -> list[Tried]:
    """Return what every setting of SET_BY gives; values: the whole params; recorded: as twins.recorded returns it."""
    ranges = recorded.groupby("statistic")["value"].agg(["median", "min", "max"])
    present, result = simulated(values, specimens), []
    for setting, statistic in tqdm(SET_BY.items(), desc="fit-strain", unit="setting"):
        block, key = setting.split(".")
        value = values["strain"]["simulate"][block][key]
        others = [factor * value for factor in factors]
        scenes = [present, *(simulated(values, specimens, setting, other) for other in others)]
        recorded_range = tuple(ranges.loc[statistic, ["median", "min", "max"]])
        result.append(Tried(setting, [value, *others], [float(each[statistic]) for each in scenes], recorded_range))
    return result


def table(results: Sequence[Tried]) -> str:
    """Return the table of all settings, one row each."""
    header = ["setting", "statistic", "recorded median [range]", "value: simulated", "nearest", "told"]
    rows = []
    for each in results:
        median, low, high = each.recorded
        pairs = sorted(zip(each.values, each.simulated, strict=True))
        rows.append(
            [
                each.setting,
                SET_BY[each.setting],
                f"{median:.3g} [{low:.3g}, {high:.3g}]",
                ", ".join(f"{value:.3g}: {statistic:.3g}" for value, statistic in pairs),
                f"{each.nearest():.3g}" + (" (as set)" if each.nearest() == each.values[0] else ""),
                "yes" if each.told() else "no",
            ]
        )
    return markdown.table(header, rows)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Print the table, and for how many settings the present value is the nearest."""
    values = params.load(workspace.params)
    if values["strain"]["source"] != "simulated":
        raise InputError("params/strain.yaml, strain.source: only a simulated scene has settings that can be fitted")
    if reason := why_not_run(workspace, "strain_recorded"):
        raise InputError(f"nothing to compare with: {reason}")
    specimens = values["strain"]["simulate"]["specimens"] if given.specimens is None else given.specimens
    results = tried(values, twins.recorded(workspace, values), given.factors, specimens)
    print(table(results))
    told = [each for each in results if each.told()]
    kept = sum(each.nearest() == each.values[0] for each in told)
    print(
        f"{len(told)} of {len(results)} settings are told by their statistic; for {kept} of these the present "
        f"value is the nearest. Simulated: median over {specimens} specimen{'s' * (specimens > 1)}."
    )


if __name__ == "__main__":
    arguments.run_tool(__doc__, main, add_arguments)
