"""Compare this machine's scores with the committed ones: reports/agreement.md.

The committed fingerprint has every score of the run that the reports were made by, and the digest of the settings that
each model was made with. Networks are trained to other last digits by other processors, and from there apart; how far
apart a number may be is measured by how far apart the seeds are.
`accept` takes this machine's scores as the fingerprint instead.
Usage: python -m pipeline.stages.agreement [accept]
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting.words.markdown import table
from pipeline.scoring import results

FINGERPRINT = Path(__file__).with_name("fingerprint.csv")
GROUP = ["experiment", "protocol", "condition", "model", "metric"]
KEY = [*GROUP, "seed"]
COLUMNS = [*KEY, "value", "tolerance", "settings"]
LEAST = 0.02  # of the value: three seeds can be closer together by chance than other digits may take them apart
ROUNDING = 1e-6
VERDICTS = ("to the bit", "to six digits", "within tolerance", "beyond", "only here", "only committed")
LISTED = 20  # of the numbers beyond tolerance


def fingerprint(scores: pd.DataFrame, settings: Mapping[tuple[str, str], str]) -> pd.DataFrame:
    """Return COLUMNS for every score; settings: (experiment, model) -> digest.

    The tolerance is the standard deviation over the seeds, at least LEAST of the value, in the score's own unit.
    """
    spread = scores.groupby(GROUP)["value"].transform("std").fillna(0.0)
    tolerance = np.maximum(spread, LEAST * scores["value"].abs())
    digest = [settings[pair] for pair in zip(scores["experiment"], scores["model"], strict=True)]
    return scores[[*KEY, "value"]].assign(tolerance=tolerance, settings=digest)


def compare(committed: pd.DataFrame, scores: pd.DataFrame) -> pd.DataFrame:
    """Return KEY, `value`, `here`, `tolerance` and one of VERDICTS for every number of either table.

    Two failed runs (NaN) agree; a failed one and a number do not.
    """
    merged = committed.merge(scores[[*KEY, "value"]].rename(columns={"value": "here"}), "outer", KEY, indicator=True)
    both, off = merged["_merge"] == "both", (merged["here"] - merged["value"]).abs()
    same = (merged["here"] == merged["value"]) | (merged["here"].isna() & merged["value"].isna())
    rules = [
        (merged["_merge"] == "right_only", "only here"),
        (merged["_merge"] == "left_only", "only committed"),
        (both & same, "to the bit"),
        (both & (off <= ROUNDING * merged["value"].abs()), "to six digits"),
        (both & (off <= merged["tolerance"]), "within tolerance"),
    ]
    merged["verdict"] = np.select([rule for rule, _ in rules], [name for _, name in rules], "beyond")
    return merged


def digests(values: Mapping) -> dict[tuple[str, str], str]:
    """Return (experiment, model) -> digest of its blocks of params.yaml, without other models and `latency`."""
    by_model = {}
    for experiment in values["experiments"]:
        shared = {key: block for key, block in values[experiment].items() if key not in ("latency", "models")}
        for model, block in values[experiment]["models"].items():
            text = json.dumps([shared, model, block], sort_keys=True)
            by_model[experiment, model] = hashlib.sha256(text.encode()).hexdigest()[:16]
    return by_model


def report(committed: pd.DataFrame, scores: pd.DataFrame, settings: Mapping[tuple[str, str], str]) -> tuple[str, str]:
    """Return agreement.md and its first sentence."""
    rows, compared, elsewhere = [], [], []
    for experiment in dict.fromkeys(experiment for experiment, _ in settings):
        there = committed[committed["experiment"] == experiment]
        here = scores[scores["experiment"] == experiment]
        if here.empty or there.empty:
            elsewhere.append(f"{experiment}: no scores {'here' if here.empty else 'in the fingerprint'}.")
            continue
        new = sorted(set(here["model"]) - set(there["model"]))
        digests_there = there.groupby("model")["settings"].agg(set)
        changed = [model for model, used in digests_there.items() if used != {settings.get((experiment, model))}]
        elsewhere += [f"{experiment}, {model}: no scores in the fingerprint." for model in new]
        elsewhere += [
            f"{experiment}, {model}: its settings in params.yaml are not those of the fingerprint." for model in changed
        ]
        left_out = {*new, *changed}
        if left_out >= set(there["model"]):
            continue
        compared.append(compare(*(part[~part["model"].isin(left_out)] for part in (there, here))))
        counts = compared[-1]["verdict"].value_counts()
        rows.append([experiment, *(str(counts.get(name, 0)) for name in VERDICTS)])
    numbers = pd.concat(compared) if compared else pd.DataFrame(columns=["verdict"])
    wrong = numbers[~numbers["verdict"].isin(VERDICTS[:3])]
    exact = int((numbers["verdict"] == VERDICTS[0]).sum())
    sentence = f"{len(numbers) - len(wrong)} of {len(numbers)} numbers agree, {exact} of them to the bit."
    lines = [
        "# Agreement with the committed results\n",
        f"{sentence} Tolerance: the standard deviation over the seeds, at least {100 * LEAST:.0f} % of the value.\n",
        table(["experiment", *VERDICTS], rows),
    ]
    lines += [f"Not compared: {text}\n" for text in elsewhere]
    if len(wrong):
        listed = wrong.head(LISTED)
        lines.append(f"## Numbers that do not agree ({len(listed)} of {len(wrong)} shown)\n")
        cells = [
            [" ".join(str(row[name]) for name in KEY), *(f"{row[name]:.6g}" for name in ("value", "here", "tolerance"))]
            for _, row in listed.iterrows()
        ]
        lines.append(table(["number", "committed", "here", "tolerance"], cells))
    return "\n".join(lines), sentence


def main() -> None:
    """Compare, or accept."""
    accept = arguments.parse(__doc__, accept=("accept", None)).accept
    scores = results.read_csv(paths.REPORTS / "scores.csv", [*KEY, "value"], "python -m pipeline.stages.collect")
    settings = digests(params.load())
    if accept:
        files.write_table(FINGERPRINT, fingerprint(scores, settings), missing="nan")
        return
    committed = results.read_csv(FINGERPRINT, COLUMNS, "python -m pipeline.stages.agreement accept")
    text, sentence = report(committed, scores, settings)
    files.write_text(paths.REPORTS / "agreement.md", text)
    print(sentence)


if __name__ == "__main__":
    run_stage(main)
