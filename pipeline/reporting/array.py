"""Report what models say of the contacts of persons whom they were not fitted to, of an array under several fingers.

Each person is tested in one of several folds, protocols that differ by a number. Folds are pooled as the claims do it:
persons are drawn anew, and of each that is drawn what is theirs (`units.drawn`).
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.claims import rules
from pipeline.reporting import experiment as common_parts
from pipeline.reporting.experiment import Parts
from pipeline.reporting.figures import curves
from pipeline.reporting.report import Report
from pipeline.results import kept
from tactile import experiments
from tactile.base import files
from tactile.base.paths import Workspace
from tactile.drawing import common
from tactile.drawing.labels import FOLDS, capitalised, model_name, plain
from tactile.drawing.markdown import interval, table
from tactile.scoring import estimates, units
from tactile.scoring.estimates import Estimate, scale_of

MAIN = "rmse"
UNITS = {MAIN: "% contact", "r2": "1", "touches_found": "1", "sum_ratio": "1", "away_rmse": "% contact"}
WITHOUT_TIME = ("convlstm", "rnn")  # models of LoMP's Table I that would see frames one after another
SHOWN = ("lomp", "cnn", "linear_array")  # models of pictures of frames, and of the table by person
RATIO = "rmse_ratio"
CONTACT = common.Maps("Contact", "%", "Share of a cell in contact (%)", 100.0)
POOLED = ["protocols", "variant", "condition", "model", "metric", "unit", *Estimate._fields, "n"]
BY_FOLD = ["protocol", "condition", "model", "metric", "unit", *Estimate._fields]
PERSONS = ["protocol", "person", *BY_FOLD[1:], "n"]
NOTHING = Estimate(np.nan, np.nan, np.nan, 0, 0)


def contacts(workspace: Workspace, folder: Path, settings: Mapping, report: Report) -> Parts:
    """Draw frames, errors and learning curves, write pooled scores and those by person; return those by fold."""
    facts, groups = experiments.facts(report.experiment), folds(report)
    main, several = facts.first_tested
    names = experiments.module(report.experiment).CONDITIONS
    conditions = [name for name in names if name in report.conditions(main)]
    words = {name: facts.tested.get((main, name), plain(name)) for name in names}
    scores = pooled_scores(report, groups, group_of(main), conditions)
    files.write_table(folder / "pooled.csv", scores)
    headings = {name: words[name] for name in conditions}

    def pool(group: str, variant: str, metric: str, several: str = "") -> str:
        chosen = scores[(scores["protocols"] == group) & (scores["variant"] == variant)]
        return pool_table(report, chosen, headings, metric, several)

    by_person = persons(report, groups[group_of(main)], several)
    files.write_table(folder / "persons.csv", by_person)
    draw(report, folder, main, headings)
    trained = {f"fold {name.rpartition('_')[2]}, {FOLDS[group]}": name for group, (name, *_) in groups.items()}
    common_parts.learning_curves(report, folder / "learning_curves.png", trained, "% contact squared")
    said = {
        "main": group_of(main), "several": several, "groups": groups, "conditions": conditions, "words": words,
        "absent": missing(report), "pool": pool, "by_person": person_table(by_person), "source": facts.source,
        "by_fold": {plain(protocol): (protocol, several, MAIN) for protocol in groups[group_of(main)]},
    }  # fmt: skip
    scored = {protocol for protocol, _ in report.scored()}
    known = [protocol for protocol in report.protocols if protocol in scored]
    runs = product(known, conditions, report.models, UNITS)
    panels = {f"{words[name]}, {plain(main)}": (main, name) for name in conditions[:2]}
    note = f"Errors are those of {plain(main)}; `accuracy` has those of all persons."
    by_fold = report.scores(runs, UNITS).reindex(columns=BY_FOLD)
    return Parts(by_fold, panels, (MAIN, f"RMSE ({UNITS[MAIN]})"), said, note)


def group_of(protocol: str) -> str:
    """Return what folds are named alike: `two_too` of `two_too_4`."""
    return protocol.rpartition("_")[0]


def folds(report: Report) -> dict[str, list[str]]:
    """Return name of a group -> its folds, of the look those that it has."""
    groups: dict[str, list[str]] = {}
    for name in report.protocols:
        if not report.of_look or report.settings["protocols"][name]["seeds"]:
            groups.setdefault(group_of(name), []).append(name)
    return groups


def missing(report: Report) -> list[str]:
    """Return the protocols, models of others, and variants that were not computed, in words."""
    rows = report.results.rows(experiment=report.experiment, metric=MAIN)
    computed = set(zip(rows["protocol"], rows["variant"], rows["model"], strict=True))
    places = {place[:2] for place in computed}
    lost = [f"`{name}`" for name in report.protocols if (name, "") not in places]
    for variant, each in [*(("", each) for each in report.of_tables.values()), *report.varied.items()]:
        known = [name for name in each.protocols if (name, variant) in places]
        if variant and not known:
            lost.append(f"variant `{variant}`")
        for model in each.models or report.models:
            if absent := [name for name in known if (name, variant, model) not in computed]:
                of = f" of variant `{variant}`" if variant else ""
                lost.append(f"{model_name(model)}{of} on {', '.join(map(plain, absent))}")
    return list(dict.fromkeys(lost))


def found(
    report: Report, protocols: Sequence[str], condition: str, model: str, metric: str, variant: str
) -> tuple[pd.Series, list[pd.Series]]:
    """Return draws of a metric over all folds together, empty where there are none, and each fold's runs."""
    budget = report.results.shown(report.experiment, protocols[0], variant)
    place = condition, model, metric, variant, budget
    runs = [report.results.found(report.experiment, protocol, *place)[0] for protocol in protocols]
    return report.results.draws(report.experiment, protocols, *place), runs


def pooled(
    report: Report, protocols: Sequence[str], condition: str, model: str, metric: str, variant: str = ""
) -> Estimate:
    """Return a metric over the test parts of all folds with its interval over draws; runs: trainings of all folds.

    Of a metric without scores by unit, mean and interval are over the folds. NOTHING where a fold was not computed.
    """
    draws, runs = found(report, protocols, condition, model, metric, variant)
    if any(fold.empty for fold in runs):
        return NOTHING
    every = np.concatenate(runs)
    failed = int((~np.isfinite(every)).sum())
    if failed < len(every) and len(draws):
        value = rules.interval(draws)
    else:
        value = estimates.estimate([fold[np.isfinite(fold)].mean() for fold in runs], scale_of(metric))
    return with_width(value._replace(runs=len(every) - failed, failed=failed))


def with_width(value: Estimate) -> Estimate:
    """Return an estimate, without its interval where only rounding gives that a width."""
    return value if value.high - value.low > 1e-9 * abs(value.mean) else value._replace(low=np.nan, high=np.nan)


def ratio(report: Report, protocols: Sequence[str], variant: str, main: Sequence[str], *place: str) -> Estimate:
    """Return a pooled error over that of the main folds, paired by draw; place: condition and model."""
    one, runs = found(report, protocols, *place, MAIN, variant)
    over, others = found(report, main, *place, MAIN, "")
    if one.empty or over.empty:
        return NOTHING
    good = np.isfinite(np.concatenate([*runs, *others]))
    value = rules.interval(one / over)._replace(runs=int(good.sum()), failed=int((~good).sum()))
    return with_width(value)  # the constant map sees nothing of what is changed


def pooled_scores(report: Report, groups: Mapping[str, Sequence[str]], main: str, names: Iterable[str]) -> pd.DataFrame:
    """Return pooled.csv: mean and interval of every model that was computed, in full precision; names: of conditions.

    RATIO is the error over that of the same model in the group `main`.
    """
    rows = []
    for (group, protocols), variant in product(groups.items(), ["", *report.varied]):
        metrics = UNITS if (group, variant) == (main, "") else UNITS | {RATIO: "1"}
        for condition, model in product(names, report.models):
            n = frames(report, protocols, condition, variant)
            for metric, unit in metrics.items():
                place = condition, model
                if metric == RATIO:
                    value = ratio(report, protocols, variant, groups[main], *place)
                else:
                    value = pooled(report, protocols, *place, metric, variant)
                if value.runs + value.failed:
                    rows.append((group, variant, *place, metric, unit, *value, n))
    return pd.DataFrame(rows, columns=POOLED)


def pool_table(
    report: Report, scores: pd.DataFrame, headings: Mapping[str, str], metric: str, several: str = ""
) -> str:
    """Return a Markdown table of a pooled metric, a row per model; empty where nothing of it was computed.

    scores: rows of pooled.csv of one group and variant; headings: condition -> words; several: a condition, whose RATIO
    is in the last column, of the models that have one.
    """
    known = {(row.condition, row.model, row.metric): row for row in scores.itertuples()}
    if not any(key[2] == metric for key in known):
        return ""
    n = scores.groupby("condition")["n"].first()
    asked = {(name, metric): f"{capitalised(words)}, {n.get(name, 0):,} frames" for name, words in headings.items()}
    if several:
        asked[several, RATIO] = f"{capitalised(headings[several])}, over the main table"
    models = [model for model in report.models if not several or model in set(scores["model"])]
    body = []
    for model in models:
        cells = [known.get((condition, model, metric)) for condition, metric in asked]
        values = [Estimate(*(getattr(cell, name) for name in Estimate._fields)) if cell else NOTHING for cell in cells]
        texts = [report.text(value, of) for value, (_, of) in zip(values, asked, strict=True)]
        body.append([model_name(model), *texts])
    if not several and metric == MAIN:
        absent = [model for model in WITHOUT_TIME if model not in report.models]
        body += [[model_name(model), *["frames have no time"] * len(asked)] for model in absent]
    return table(["Model", *asked.values()], body)


def frames(report: Report, protocols: Sequence[str], condition: str, variant: str) -> int:
    """Return how many frames of a condition the folds test on."""
    rows = report.results.rows(experiment=report.experiment, condition=condition, metric=MAIN, variant=variant)
    rows = rows[rows["protocol"].isin(list(protocols))]
    return int(rows.groupby("protocol")["n"].first().sum())


def persons(report: Report, protocols: Sequence[str], condition: str) -> pd.DataFrame:
    """Return persons.csv: the RMSE of the models SHOWN on each person, its interval over their frames drawn anew."""
    rows = []
    for protocol, model in product(protocols, [model for model in SHOWN if model in report.models]):
        place = {"experiment": report.experiment, "protocol": protocol, "condition": condition, "model": model}
        known = report.results.rows(**place, metric=MAIN + units.SUFFIX)
        known = known[known["budget"].isin(["", report.results.shown(report.experiment, protocol)])]
        known = known[~known["variant"].str.contains("/")]  # of a variant
        for person, own in known.groupby(known["variant"].map(person_of)):
            square, n = own.groupby("variant")["value"].mean(), own.groupby("variant")["n"].first()
            mean, runs = float(np.sqrt(np.average(square, weights=n))), own["seed"].nunique()
            value = rules.interval(units.drawn(own, MAIN))._replace(mean=mean, runs=runs)
            value = value if value.low < value.high else value._replace(low=np.nan, high=np.nan)
            rows.append((protocol, person, condition, model, MAIN, UNITS[MAIN], *value, n.sum()))
    return pd.DataFrame(rows, columns=PERSONS)


def person_of(unit: str) -> str:
    """Return whose a unit is: `P01` of `unit_P01_7`."""
    return unit.partition("_")[2].rpartition("_")[0]


def person_table(by_person: pd.DataFrame) -> str:
    """Return a Markdown table of persons.csv, a row per person; empty where there is none."""
    models = list(dict.fromkeys(by_person["model"]))
    body = []
    for person, rows in by_person.sort_values("person", kind="stable").groupby("person"):
        said = {row.model: Estimate(*(getattr(row, name) for name in Estimate._fields)) for row in rows.itertuples()}
        first = rows.iloc[0]
        body.append([str(person), plain(first["protocol"]), f"{int(first['n']):,}"])
        body[-1] += [interval(said[model]) if model in said else "not run" for model in models]
    return table(["Person", "Tested in", "Frames", *map(model_name, models)], body) if body else ""


def draw(report: Report, folder: Path, protocol: str, conditions: Mapping[str, str]) -> None:
    """Draw the frames whose maps are kept, and the errors of all that are; conditions: name -> words."""
    rows, caption = report.drawn(protocol), report.caption(protocol)
    rows = rows[(rows["window"] != kept.WHOLE) & (rows["model"] != kept.READING)].sort_values("window", kind="stable")
    of = {model: own for model in (kept.LABEL, *report.models) if len(own := rows[rows["model"] == model])}
    if kept.LABEL not in of:
        return
    label = of.pop(kept.LABEL)
    condition = label["condition"].astype(str).to_numpy()
    errors = {
        model: {words: own["mean_square"].to_numpy(float)[condition == name] for name, words in conditions.items()}
        for model, own in of.items()
    }
    title, axis = "Error of a frame, by the number of its contacts", "Mean squared error of a frame"
    curves.boxes(folder / "errors.png", errors, title, caption, f"{axis} ((% contact)², lower is better)", "frames")
    mapped = label["map"].map(len).to_numpy() > 0
    at = np.concatenate([np.flatnonzero(mapped & (condition == name)) for name in conditions])
    person = label["recording"].astype(str).str.partition("/")[0].to_numpy()
    names = [f"{conditions[condition[row]]}\nperson {person[row]}" for row in at]
    sensor, cells = report.settings["sensor"], report.settings["label"]
    shape = (len(at), cells["map_rows"], cells["map_cols"])
    shown = {kept.LABEL: label} | {model: of[model] for model in SHOWN if model in of}
    maps = {model: np.stack(own["map"].iloc[at]).astype(float).reshape(shape) for model, own in shown.items()}
    readings, truth = np.stack(label["counts"].iloc[at]), maps.pop(kept.LABEL)
    source = experiments.facts(report.experiment).source
    credit = f"{caption}; recordings: {source.repository}, {source.licence}"
    chosen = "Frames spread evenly over the test part, chosen before any model was fitted"
    common.maps(folder / "frames.png", chosen, credit, names, readings, truth, maps, sensor, CONTACT)
