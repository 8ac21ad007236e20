"""Write where trained models fail: reports/stability, from what the evidence scored under stress.

A condition of an experiment has one table of the severities at which half of the skill of each model is lost, three
sentences that follow from it, and the errors over severity. What was not computed is said; the look has no part in it.
"""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.claims import stability as verdicts
from pipeline.claims.stability import DOWN, FAILURES, FLOOR, LINEAR, LOG, NO_CLEAN, NO_ORDER, STARTS, UNUSABLE, UP
from pipeline.reporting.figures import stability as figures
from pipeline.reporting.tables import Table
from pipeline.reporting.texts import render
from pipeline.results import one_table, shards
from pipeline.results.claim_inputs import FULL
from tactile.base import files
from tactile.base.paths import Workspace
from tactile.drawing.labels import (
    MEASURES,
    capitalised,
    condition_name,
    experiment_name,
    model_name,
    perturbation,
    split_name,
)
from tactile.drawing.markdown import number
from tactile.experiments import facts
from tactile.scoring import estimates
from tactile.scoring.estimates import Estimate

COLUMNS = [
    "experiment",
    "model",
    "seed",
    "perturbation",
    "severity",
    "metric",
    "unit",
    "value",
]  # of reports/stress.csv
COLUMNS += ["protocol", "condition", "variant", "budget", "n"]
FINDINGS = ["experiment", "protocol", "condition", "breaks", "holds", "take"]
HELPED = "faults"  # variant: trained with dead elements, gains and offsets drawn anew in each batch
NAMED = 3  # tests at most for which another model is recommended, and models that keep their skill


def stability(workspace: Workspace, folder: Path, values: Mapping) -> pd.DataFrame:
    """Write the report of all experiments into an empty folder, and return reports/stress.csv.

    failures.csv has a row for each model, test and direction, not_usable.csv the models that are not usable clean,
    findings.csv the sentences, starts.csv how often training failed, helped.csv what training with faults changes.
    """
    stress, rows, sets = shards.stress(workspace), shards.read(workspace), shards.read_sets(workspace)
    own_logs, parts = one_table.of_own_logs(values), []
    tables = {name: [pd.DataFrame(columns=columns)] for name, columns in (
        ("failures", FAILURES), ("not_usable", UNUSABLE), ("findings", FINDINGS), ("starts", STARTS), ("helped", [])
    )}  # fmt: skip
    for experiment in values["experiments"]:
        part = {"title": experiment_name(experiment), "conditions": [], "tests": None, "missing": ""}
        asked = values["stress"][experiment]
        runs = verdicts.runs(stress, experiment)
        if experiment in own_logs:
            part["missing"] = "The logs are your own, and the evidence is of others"
        elif runs.empty:
            computing = [name for name, each in sets.items() if each.experiment == experiment and each.stress]
            part["missing"] = f"Not computed yet; `tactile evidence {' '.join(computing)}` does"
        else:
            clean = verdicts.clean_errors(rows, runs, experiment)
            judged, bad = verdicts.failures(runs, clean, experiment, asked["usable"])
            for place in dict.fromkeys(zip(runs["protocol"], runs["condition"], strict=True)):
                told, found = condition(experiment, *place, runs, judged, bad, folder)
                part["conditions"].append(told)
                tables["findings"] += found
            part["tests"] = tests(judged) if len(judged) else None
            part["lacking"] = lacking(runs, asked, values[experiment]["models"])
            tables["failures"].append(judged)
            tables["not_usable"].append(bad)
            other = verdicts.runs(stress, experiment, HELPED)
            if len(other):
                tables["helped"].append(helped_of(other, runs, rows, experiment, asked["usable"]))
        if experiment not in own_logs and len(rows):
            tables["starts"].append(verdicts.starts(rows, experiment))
        parts.append(part)
    joined = {name: pd.concat(each[1:] or each, ignore_index=True) for name, each in tables.items()}
    for name, table in joined.items():
        if name != "helped" or len(table):
            files.write_table(folder / f"{name}.csv", table)
    told = {"starts": starts(joined["starts"]), "helped": helped(joined["helped"]) if len(joined["helped"]) else None}
    told |= {"worse": verdicts.WORSE, "draws": verdicts.DRAWS, "span": verdicts.SPAN, "highest": figures.HIGHEST}
    told["fewest"] = estimates.FEWEST
    files.write_text(folder / "README.md", render("stability", parts=parts, **told))
    return stress[COLUMNS]


def helped_of(
    other: pd.DataFrame, runs: pd.DataFrame, rows: pd.DataFrame, experiment: str, usable: Mapping[str, float]
) -> pd.DataFrame:
    """Return `verdicts.helped` of a variant's runs, of the seeds that the same models of the tables have, too.

    Models are held against the constant model of the tables. No model is left out for not being usable.
    """
    key = ["protocol", "condition", "model", "seed"]
    both = pd.MultiIndex.from_frame(other[key]).intersection(pd.MultiIndex.from_frame(runs[key]))
    floor = runs[runs["model"] == FLOOR]
    plain, varied = (each[pd.MultiIndex.from_frame(each[key]).isin(both)] for each in (runs, other))
    judged = []
    for each, variant in ((plain, ""), (varied, HELPED)):
        table = pd.concat([each, floor])
        clean = verdicts.clean_errors(rows, each, experiment, variant)
        clean = pd.concat([clean, verdicts.clean_errors(rows, floor, experiment)])
        judged.append(verdicts.failures(table, clean, experiment, dict.fromkeys(usable, np.inf))[0])
    return verdicts.helped(*judged)


def condition(
    experiment: str, protocol: str, name: str, runs: pd.DataFrame, judged: pd.DataFrame, bad: pd.DataFrame, folder: Path
) -> tuple[dict, list[pd.DataFrame]]:
    """Draw one condition, and return what its part of the report holds, and its row of findings.csv if it has one."""
    here = (runs["protocol"] == protocol) & (runs["condition"] == name)
    rows = judged[(judged["protocol"] == protocol) & (judged["condition"] == name)]
    out = bad[(bad["protocol"] == protocol) & (bad["condition"] == name)]
    words, (error, unit) = condition_name(experiment, protocol, name), error_words(experiment)
    title = f"{experiment_name(experiment)}, {words}"
    file, known = f"{stability_file(experiment, protocol, name)}.png", rows[rows["largest"].notna()]
    told = {"title": title, "sentences": "", "table": None, "figure": "", "caption": ""}
    told["not_usable"] = [f"{model_name(row.model)} ({error(row.clean)})" for row in out.itertuples()]
    told["limit"] = f"{error(limit_of(rows, out))} {unit}" if len(out) else ""
    told["without_axis"] = without_axis(runs[here], rows, experiment)
    told |= {"intervals": "", "seeds": facts(experiment).seeds, "bands": bool(known["over"].any())}
    found = []
    if len(known) or len(out):
        said = findings(experiment, protocol, name, runs[here], rows, out)
        place = {"experiment": experiment, "protocol": protocol, "condition": name}
        found.append(pd.DataFrame([place | said], columns=FINDINGS))
        told["sentences"] = " ".join(said[part] for part in FINDINGS[3:] if said[part])
    if len(known):
        told["table"], told["intervals"] = stability_table(rows), intervals(rows)
        budget = FULL if FULL in set(known["budget"]) else "no"
        drawn = panels(runs[here], known)
        if drawn:
            seeds = runs_of(known)
            of = f"{title} ({protocol_words(protocol)}, budget {budget}, {seeds})"
            metric = facts(experiment).metric
            wrong = "Images classified incorrectly (share)"
            label = wrong if metric == "accuracy" else f"{MEASURES[metric]} ({unit})"
            figures.small_multiples(folder / file, drawn, known["floor"].mean(), label, of)
            shown, total = len(drawn[0].curves), known["model"].nunique()
            told["figure"] = file
            few = f"The {shown} models of {total} with the least clean error" if shown < total else "All models"
            told["caption"] = f"{few} that are usable clean; {protocol_words(protocol)}, budget {budget}, {seeds}."
    return told, found


def protocol_words(protocol: str) -> str:
    """Return the split of a protocol."""
    return f"split {split_name(protocol)}"


def runs_of(rows: pd.DataFrame, things: str = "seeds") -> str:
    """Return how many runs the rows of failures.csv are of, in words; things: what each seed has another one of."""
    numbers = sorted({int(each) for each in rows["seeds"]})
    said = f"{numbers[0]} to {numbers[-1]}" if len(numbers) > 1 else f"{numbers[0]}"
    return f"{said} {things.removesuffix('s') if numbers == [1] else things}"


def intervals(rows: pd.DataFrame) -> str:
    """Return what the intervals of `stability_table` are over, in a sentence; rows: of failures.csv, of one condition.

    Fewer runs than an interval needs, and no blocks, have none.
    """
    known = rows[rows["largest"].notna()]
    things, over = facts(known["experiment"].iloc[0]).seeds, []
    for what, own in known[known["half_low"].notna()].groupby("over", sort=False):
        tests = [perturbation(test)[0] for test in own["perturbation"].unique()]
        over.append({"what": what, "of_runs": what == things, "tests": tests})
    runs = runs_of(known, things)
    return render("stability_intervals", over=over, runs=runs, one=runs.startswith("1 ")).strip()


def limit_of(rows: pd.DataFrame, out: pd.DataFrame) -> float:
    """Return the limit of use of a condition."""
    return float(pd.concat([rows["usable"], out["usable"]]).iloc[0])


def stability_file(experiment: str, protocol: str, condition: str) -> str:
    """Return the name of the figure of a condition; the protocol alone where it says the condition, too."""
    said = condition in ("all", protocol) or protocol.endswith(f"_{condition}")
    return "_".join([experiment, protocol, *([] if said else [condition])])


def lacking(runs: pd.DataFrame, asked: Mapping, models: Collection[str]) -> list[str]:
    """Return what the settings ask for and no committed shard has: models, tests and protocols, in words."""
    wanted = {"model": models, "perturbation": asked["perturbations"], "protocol": asked["protocols"]}
    named = {"model": model_name, "perturbation": lambda test: perturbation(test)[0], "protocol": protocol_words}
    return [named[column](each) for column, names in wanted.items() for each in names if each not in set(runs[column])]


def panels(runs: pd.DataFrame, rows: pd.DataFrame) -> list[figures.Panel]:
    """Return what is drawn of a condition: tests with two severities or more, of the models with the least error."""
    best = rows.drop_duplicates("model").sort_values("clean", kind="stable")["model"].head(figures.DRAWN)
    drawn = []
    for (_, _, test), models in verdicts.groups(runs[runs["model"].isin([*best, FLOOR])]):
        own = rows[rows["perturbation"] == test]
        curves = {}
        for model in best:
            judged = own[(own["model"] == model) & own["largest"].notna()]
            if len(judged) and np.count_nonzero(models[model].severities) > 1:
                curves[model] = curve(models[model], judged)
        if curves:
            name, unit, _ = perturbation(test)
            axis = LOG if LOG in set(own["axis"]) else LINEAR
            floor = figures.Floor(models[FLOOR].severities, models[FLOOR].errors.mean(axis=0))
            drawn.append(figures.Panel(capitalised(name), unit, axis, curves, floor))
    return drawn


def curve(own: verdicts.Runs, judged: pd.DataFrame) -> figures.Curve:
    """Return the curve of a model under one test; judged: its rows of failures.csv."""
    if own.over in ("", verdicts.SEEDS):
        levels = [estimates.estimate(each, estimates.LOG) for each in own.errors.T]
        low, high = (np.array([getattr(each, end) for each in levels]) for end in ("low", "high"))
    else:
        low, high = np.quantile(own.draws, verdicts.TAILS, axis=0)
    of_direction = {way: (each.severities, each.errors.mean(axis=0)[None]) for way, each in verdicts.walked(own)}
    half = [
        (row.half_at, verdicts.error_at(*of_direction[row.direction], abs(row.half_at), row.axis)[0])
        for row in judged.itertuples()
        if np.isfinite(row.half_at)
    ]
    return figures.Curve(own.severities, own.errors.mean(axis=0), low, high, half)


def findings(
    experiment: str, protocol: str, name: str, runs: pd.DataFrame, rows: pd.DataFrame, out: pd.DataFrame
) -> dict[str, str]:
    """Return what breaks first, what holds and which model to take where, in a sentence each, of one condition.

    runs: of the condition; rows, out: of failures.csv and of the models that are not usable clean.
    """
    (error, unit), known = error_words(experiment), rows[rows["largest"].notna()]
    given = {"condition": condition_name(experiment, protocol, name), "unit": unit, "least": None}
    if known.empty:
        if out["clean"].notna().any():
            least = out.sort_values("clean", kind="stable").iloc[0]
            given["least"] = {"model": model_name(least["model"]), "clean": error(least["clean"])}
            given |= {"limit": error(least["usable"]), "floor": error(least["floor"])}
        return _sentences(given | {"models": 0})
    best = known.sort_values("clean", kind="stable").iloc[0]
    count = known["model"].nunique()
    given |= {"models": count, "best": {"model": model_name(best["model"]), "clean": error(best["clean"])}}
    order = verdicts.hardest(known)
    at = {test: known[(known["perturbation"] == test[0]) & (known["direction"] == test[1])] for test in order}
    lost = {test: own[own["half_at"].notna()] for test, own in at.items()}
    first = next((test for test in order if len(lost[test])), None)
    given["first"] = _first(lost[first], at[first]) if first else None
    held = [test for test in reversed(order) if lost[test].empty]
    given["held"] = [_up_to(test, at[test]) for test in sorted(held, key=list(at).index)]
    most = min(reversed(order), key=lambda test: len(lost[test]) / len(at[test]))
    kept = len(at[most]) - len(lost[most])
    given["most"] = {"test": _up_to(most, at[most]), "kept": kept, "of": len(at[most])} if kept else None
    instead = sorted(verdicts.better(runs, known), key=lambda each: each.error / each.of_best)[:NAMED]
    given["instead"] = {}
    for each in instead:
        where = f"{perturbation(each.perturbation)[0]} at {severity(each.severity)}"
        told = f"{where} ({error(each.error)} in place of {error(each.of_best)})"
        given["instead"].setdefault(model_name(each.model), []).append(told)
    given["never"] = known[(known["model"] == best["model"]) & known["half_at"].notna()].empty
    given["runs"], given["untold"] = runs_of(known[known["model"] == best["model"]]), not best["over"]
    return _sentences(given)


def _first(lost: pd.DataFrame, own: pd.DataFrame) -> dict:
    """Return what is said of the test that takes half of the skill first; lost: rows of the models that lose it."""
    order = lost.assign(size=lost["half_at"].abs()).sort_values("size", kind="stable")
    ends = [
        {"model": model_name(row["model"]), "at": half_at(row).replace("< 1", "less than one")}
        for row in order.to_dict("records")
    ]
    kept = [model_name(model) for model in own["model"] if model not in set(lost["model"])]
    said = {
        "test": perturbation(own["perturbation"].iloc[0])[0],
        "unit": own["unit"].iloc[0],
        "lost": len(lost),
        "of": len(own),
    }
    return said | {"earliest": ends[0], "latest": ends[-1], "kept": kept[:NAMED], "more": len(kept[NAMED:])}


def _up_to(test: tuple[str, str], own: pd.DataFrame) -> str:
    """Return a test and the largest severity of it that was tried."""
    way = {UP: "up to", DOWN: "down to"}[test[1]]
    return f"{perturbation(test[0])[0]} ({way} {own['largest'].iloc[0]:g})"


def _sentences(given: Mapping) -> dict[str, str]:
    """Return the sentences that the template makes: a line each, an empty one where there is none."""
    lines = render("stability_findings", **given).split("\n")
    said = [line.strip() for line in lines if line.strip()]
    return dict(zip(FINDINGS[3:], [*said, "", "", ""][:3], strict=True))


def stability_table(rows: pd.DataFrame) -> Table:
    """Return at which severity half of the skill of each model is lost, the least clean error first.

    rows: of failures.csv, of one condition. A test whose severities have two signs has a column for each.
    """
    known = rows[rows["largest"].notna()]
    error, unit = error_words(rows["experiment"].iloc[0])
    tests = list(dict.fromkeys(zip(known["perturbation"], known["direction"], known["unit"], strict=True)))
    cells = {(row["model"], row["perturbation"], row["direction"]): half_at(row) for row in known.to_dict("records")}
    clean = known.drop_duplicates("model").set_index("model")["clean"].sort_values(kind="stable")
    table = [
        [model_name(model), error(value), *(cells.get((model, *test[:2]), "-") for test in tests)]
        for model, value in clean.items()
    ]
    return Table(["Model", f"Clean ({unit})", *(f"{test_name(*test[:2], known)} ({test[2]})" for test in tests)], table)


def by_test(table: Table) -> Table:
    """Return `stability_table` with a row for each test: few models beside each other fit a page, many tests do not."""
    columns = list(zip(table.header, *table.rows, strict=True))
    return Table(["Test", *columns[0][1:]], [list(column) for column in columns[1:]])


def error_words(experiment: str) -> tuple[Callable[[float], str], str]:
    """Return how an error of an experiment's main metric is written, and its unit."""
    own = facts(experiment)
    if own.metric == "accuracy":
        return lambda error: number(100 * error, 1), "% of images named wrongly"
    return number, own.output_unit


def test_name(test: str, direction: str, rows: pd.DataFrame) -> str:
    """Return the name of a test, and of its sign where its severities have both; rows: of failures.csv."""
    both = rows.loc[rows["perturbation"] == test, "direction"].nunique() > 1
    sign = {UP: ", above 0", DOWN: ", below 0"}[direction] if both else ""
    return capitalised(perturbation(test)[0]) + sign


def severity(value: float) -> str:
    """Return a severity in two digits, or whole."""
    return f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}"


def half_at(row: Mapping) -> str:
    """Return `at [low, high]`, the severity at which half of the skill is lost; an open end is that of what was tried.

    row: of failures.csv. Of elements or lines there is none less than one.
    """
    if row["unit"].startswith("number of") and row["half_at"] < 1:
        return "< 1"
    open_end = f"{'>' if row['direction'] == UP else '<'} {row['largest']:g}"
    middle = severity(row["half_at"]) if np.isfinite(row["half_at"]) else open_end
    ends = [severity(row[f"half_{end}"]) if np.isfinite(row[f"half_{end}"]) else open_end for end in ("low", "high")]
    unknown = pd.isna(row["half_low"]) or set(ends) == {open_end}
    return middle if unknown else f"{middle} [{', '.join(ends)}]"


def tests(rows: pd.DataFrame) -> Table:
    """Return what each test of failures.csv does, the largest severities that were tried, and the axis."""
    told = []
    for test, own in rows.groupby("perturbation", sort=False):
        name, unit, meaning = perturbation(test)
        most = ", ".join(f"{each:g}" for each in dict.fromkeys(own["largest"].dropna())) or "-"
        axes = ", ".join(dict.fromkeys(own["axis"].dropna())) or own["half_note"].iloc[0]
        told.append([capitalised(name), meaning, unit, most, axes])
    return Table(["Test", "What it does", "Unit of the severity", "Largest severity", "Axis"], told)


def without_axis(table: pd.DataFrame, rows: pd.DataFrame, experiment: str) -> Table | None:
    """Return the errors under tests without an order or a clean level, or None where there is none.

    table: `stability.runs` of one condition; rows: of failures.csv of it. Of other sensors it is the mean of all.
    """
    special = rows[rows["largest"].isna() & rows["half_note"].isin([NO_ORDER, NO_CLEAN])]
    if special.empty:
        return None
    error, unit = error_words(experiment)
    columns = {}
    for test, note in dict.fromkeys(zip(special["perturbation"], special["half_note"], strict=True)):
        name, of, _ = perturbation(test)
        own = table[(table["perturbation"] == test) & (table["severity"] != 0)]
        if note == NO_ORDER:
            columns[f"{capitalised(name)}, mean of {own['severity'].nunique()}"] = own
        else:
            columns |= {f"{capitalised(name)}: {at:g} ({of})": each for at, each in own.groupby("severity")}
    clean = special.drop_duplicates("model").set_index("model")["clean"]
    cells = []
    for model in dict.fromkeys([*clean.sort_values(kind="stable").index, verdicts.FLOOR]):
        runs = [own[own["model"] == model].groupby("seed")["error"].mean() for own in columns.values()]
        levels = [estimates.estimate(each, estimates.LOG) for each in runs]
        row = [model_name(model), *([error(clean.get(model, np.nan))] if clean.notna().any() else [])]
        cells.append(row + [_interval(each, error) for each in levels])
    head = ["Model", *([f"Clean ({unit})"] if clean.notna().any() else [])]
    return Table([*head, *columns], cells)


def _interval(level: Estimate, error: Callable[[float], str]) -> str:
    """Return `mean [low, high]`, or the mean alone where there is no interval."""
    ends = "" if np.isnan(level.low) else f" [{error(level.low)}, {error(level.high)}]"
    return f"{error(level.mean)}{ends}" if level.runs else "-"


def starts(table: pd.DataFrame) -> Table:
    """Return how often training fails, by network; table: columns stability.STARTS of all experiments."""
    rows = []
    for row in table.to_dict("records"):
        failed, worse = (f"{row[name]} ({100 * row[name] / row['starts']:.0f} %)" for name in ("failed", "worse"))
        rates = [_rate(row[name]) for name in ("third", "thrice")]
        rows.append([experiment_name(row["experiment"]), model_name(row["model"]), str(row["starts"]), failed, worse])
        rows[-1] += [*rates, str(row["rate_seeds"]) if row["rate_seeds"] else "-"]
    head = ["Experiment", "Model", "Starts", "Failed", "Worse than twice the median"]
    return Table([*head, "Error at a third of the learning rate", "At three times", "Seeds of these"], rows)


def _rate(ratio: float) -> str:
    """Return how many times the error is that of the learning rate itself."""
    return "not computed" if np.isnan(ratio) else "failed" if np.isinf(ratio) else f"{ratio:.2f} x"


def helped(table: pd.DataFrame) -> Table:
    """Return clean error and severities of a model as in the tables and of its variant; table: verdicts.helped.

    Rows in which neither loses half of its skill are left out.
    """
    rows = []
    for row in table[table["half_at"].notna() | table["half_at_variant"].notna()].to_dict("records"):
        error, unit = error_words(row["experiment"])
        other = {"direction": row["direction"], "unit": row["unit"], "largest": row["largest_variant"]}
        other |= {name: row[f"{name}_variant"] for name in ("half_at", "half_low", "half_high")}
        where = f"{experiment_name(row['experiment'])}, {condition_of(row)}"
        name = test_name(row["perturbation"], row["direction"], table[table["experiment"] == row["experiment"]])
        clean = " / ".join(error(row[key]) for key in ("clean", "clean_variant"))
        rows.append([where, model_name(row["model"]), f"{clean} {unit}", f"{name} ({row['unit']})"])
        over = dict.fromkeys(each for each in (row["over"], row["over_variant"]) if each)
        rows[-1] += [half_at(row), half_at(other), ratio(row), " / ".join(over) or "-"]
    head = ["Condition", "Model", "Clean error, plain / with faults", "Test", "Half lost at, plain"]
    return Table([*head, "Half lost at, with faults", "Ratio", "Intervals over"], rows)


def ratio(row: Mapping) -> str:
    """Return the ratio of severities of a row of `verdicts.helped`, a bound where one is beyond what was tried."""
    if np.isfinite(row["ratio"]):
        return f"{row['ratio']:.2f}"
    if np.isfinite(row["half_at"]):
        return f"> {row['largest_variant'] / row['half_at']:.2f}"
    return f"< {row['half_at_variant'] / row['largest']:.2f}"


def condition_of(row: Mapping) -> str:
    """Return the condition of a row of failures.csv, in words."""
    return condition_name(row["experiment"], row["protocol"], row["condition"])
