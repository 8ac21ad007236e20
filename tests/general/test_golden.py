"""What stands in reports/ follows from the committed tables: derived files are computed anew, without training."""

import fnmatch
import json
import re
import shutil
import subprocess
from itertools import product

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT
from builders.prose import faults

from benchmarks import gallery
from benchmarks import report as benchmarks_report
from pipeline.claims import entries, judge
from pipeline.claims.rules import CONTRADICTED, OFF, REPRODUCED, UNDECIDED
from pipeline.reporting import array, recorded, speed, stability, studies
from pipeline.reporting import claims as claims_report
from pipeline.reporting import experiment as experiment_report
from pipeline.reporting.page import sections
from pipeline.results import one_table, shown
from pipeline.stages import metrics, render, render_study, twins
from pipeline.studies import counts
from tactile.base import params
from tactile.base.paths import Workspace
from tactile.commands import coverage
from tactile.drawing.labels import FRONTS, SPREAD
from tactile.experiments import facts
from tactile.scoring import estimates

REPOSITORY = Workspace(ROOT)
VALUES, REPORTS = params.load(REPOSITORY.params), REPOSITORY.reports
CLAIMS, _ = entries.read(REPOSITORY)
NUMBERS = [
    "published",
    "ours",
    "low",
    "high",
    "power",
    "seeds",
    "control_value",
    "p",
    "weak",
    "draw_low",
    "draw_high",
    "flips_at",
]
WORDS = ["verdict", "reason", "budget", "over", "unit", "control"]


def relative(path) -> str:
    return path.relative_to(REPORTS).as_posix()


def same(found, committed) -> bool:
    return np.allclose(np.asarray(found, float), np.asarray(committed, float), rtol=1e-9, atol=1e-12, equal_nan=True)


def read(path) -> pd.DataFrame:
    """A table whose words are "" where they are missing."""
    table = pd.read_csv(path)
    return table.fillna(dict.fromkeys(table.select_dtypes(exclude="number"), ""))


@pytest.fixture(scope="module")
def judged(kept) -> pd.DataFrame:
    """claims.csv, computed anew."""
    return judge.weighed(judge.table(CLAIMS, kept))


def test_claims_follow_from_the_results(judged):
    found, committed = judged.set_index("id"), read(REPORTS / "claims.csv").set_index("id")
    assert list(found.index) == list(committed.index) and len(found) > 150
    for claim, row in found.iterrows():
        assert list(row[WORDS]) == list(committed.loc[claim, WORDS]), claim
        assert same(row[NUMBERS], committed.loc[claim, NUMBERS]), claim
    text = claims_report.text(REPOSITORY, judged, {claim.id: claim.tried for claim in CLAIMS})
    assert text == (REPORTS / "claims.md").read_text(encoding="utf-8")


def test_every_reproduced_sentence_has_a_control_that_failed():
    committed = read(REPORTS / "claims.csv")
    rows = committed[committed["verdict"].eq(REPRODUCED) & committed["kind"].eq(entries.SENTENCE)]
    assert len(rows) > 20 and (rows["control"] != "").all() and np.isfinite(rows["control_value"]).all()
    passed = committed[committed["reason"].str.startswith("its control passes, too")]
    assert len(passed) > 5 and set(passed["verdict"]) == {UNDECIDED}


@pytest.mark.parametrize("experiment", [name for name in VALUES["experiments"] if facts(name).paper])
def test_a_claim_has_the_interval_of_the_same_number_in_the_readme(experiment, kept):
    """Also where the scene was calibrated by it, and of a ratio, on the same scale."""
    committed, tested = read(REPORTS / "claims.csv").set_index("id"), set()
    by_number = {tuple(claim.values.values()): claim for claim in CLAIMS if claim.rule in ("near", "calibrated")}
    for column in shown.paper_table(kept, experiment):
        for model, cell in column.cells.items():
            share = facts(experiment).paper.times == 100
            name = f"{column.condition}.{model}"
            claim = by_number.get((f"100 * {name}" if share else name,))
            if claim is None or claim.protocol.format(condition=column.condition) != cell.protocol:
                continue
            found = kept.estimate(*cell)
            found = found.percent() if share else found
            assert same(committed.loc[claim.id, ["ours", "low", "high"]], found[:3]), claim.id
            tested.add(claim.rule)
    assert "near" in tested and (experiment != "strain" or "calibrated" in tested)


def test_the_reason_for_every_contradiction_was_looked_for():
    committed, tried = read(REPORTS / "claims.csv"), {claim.id: claim.tried for claim in CLAIMS}
    unlike_the_paper = committed[committed["verdict"].isin([CONTRADICTED, OFF])]["id"]
    assert len(unlike_the_paper) > 20 and [claim for claim in unlike_the_paper if not tried[claim]] == []


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_metrics_follow_from_the_speed_table(experiment):
    table, folder = REPORTS / experiment / "speed" / "table2.csv", REPORTS / "metrics" / experiment
    found = metrics.of_experiment(pd.read_csv(table)) if table.exists() else {}
    assert found == {path.relative_to(folder): json.loads(path.read_text()) for path in folder.rglob("*.json")}


TABLES = [path for path in sorted(REPORTS.glob("*/accuracy/table*.csv")) if "model" in pd.read_csv(path, nrows=0)]
SPEEDS = sorted(REPORTS.glob("*/speed/table2.csv"))


@pytest.fixture(scope="module")
def kept() -> one_table.Results:
    """The evidence, and what is in reports/ of all else."""
    return one_table.results(REPOSITORY, one_table.of_own_logs(VALUES))


@pytest.mark.parametrize("path", TABLES, ids=relative)
def test_a_table_of_accuracy_has_means_and_intervals_of_the_results(path, kept):
    columns, experiment = ["mean", "low", "high", "runs", "failed"], path.relative_to(REPORTS).parts[0]
    for row in read(path).itertuples():
        found = kept.estimate(experiment, row.protocol, row.condition, row.model, row.metric)
        assert same(found, [getattr(row, column) for column in columns]), row


@pytest.mark.parametrize("path", SPEEDS, ids=relative)
def test_a_speed_table_has_the_measured_times_and_the_models_on_the_front(path):
    table, experiment = read(path), path.relative_to(REPORTS).parts[0]
    latency = pd.read_csv(REPORTS / "latency.csv").set_index(["experiment", "model", "batch"])
    for row in table.itertuples():
        one, many = (latency.loc[(experiment, row.model, batch)] for batch in (row.batch, row.large_batch))
        times = [one["p50_ms"], one["p95_ms"], 1e3 * row.large_batch / many["p50_ms"], one["size_bytes"]]
        assert same([row.p50_ms, row.p95_ms, row.predictions_per_s, row.size_bytes], times), row
    for _, panel in table.groupby("panel"):
        for time, column in FRONTS.items():
            error = panel["error"].where(panel["failed"] == 0)
            assert list(speed.pareto(panel[SPREAD[time]], error)) == list(panel[column] == 1), (column, panel)


DRAWN = ("draw", "draw_laws", "draw_readings", "draw_confusions", "draw_task", "draw_time", "draw_studies", "presses")


@pytest.fixture
def laid_out(workspace, monkeypatch):
    """`laid_out(experiment)`: a new report of the committed evidence.

    Figures are not drawn; those that are committed are there, since a report names the ones that are.
    """
    (workspace.root / "evidence").symlink_to(ROOT / "evidence")

    def make(experiment: str):
        workspace.reports.mkdir()
        shutil.copy(REPORTS / "counts.csv", workspace.reports)
        target = workspace.root / "report"
        for part in ("accuracy", "speed"):
            (target / part).mkdir(parents=True)
            for figure in (REPORTS / experiment / part).glob("*.png"):
                (target / part / figure.name).touch()
        for module, name in product([render.SIMULATED.get(experiment, recorded), array], ("read_latents", *DRAWN)):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, lambda *given, **named: ())
        monkeypatch.setattr(experiment_report, "learning_curves", lambda *given: None)
        monkeypatch.setattr(experiment_report.speed_figures, "chart", lambda *given: None)
        render.write(workspace, target, experiment, VALUES[experiment], look=False)
        return target

    return make


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_the_report_of_an_experiment_follows_from_the_evidence(experiment, laid_out):
    target = laid_out(experiment)
    files = {path.relative_to(target) for path in target.rglob("*.*") if path.suffix != ".png"}
    folder = REPORTS / experiment
    assert files == {path.relative_to(folder) for path in folder.rglob("*.*") if path.suffix != ".png"}
    for file in sorted(files):
        assert_same_file(target / file, folder / file)


def assert_same_file(found, committed) -> None:
    """The same words, and in tables the same numbers to nine digits."""
    if found.suffix != ".csv":
        assert found.read_text(encoding="utf-8") == committed.read_text(encoding="utf-8"), committed
        return
    ours, theirs = read(found), read(committed)
    assert list(ours) == list(theirs) and len(ours) == len(theirs), committed
    for column in ours:
        number = pd.api.types.is_numeric_dtype(ours[column]) and pd.api.types.is_numeric_dtype(theirs[column])
        equal = (
            same(ours[column], theirs[column])
            if number
            else ours[column].astype(str).equals(theirs[column].astype(str))
        )
        assert equal, (committed, column)


STUDIES = {"stability": stability.stability, "rightsize": studies.rightsize, "physics": studies.physics}
OF_STUDIES = {name: render_study.TABLES.get(study, f"{name}.csv") for name, study in STUDIES.items()}  # their tables


@pytest.mark.parametrize("name", STUDIES)
def test_the_report_of_a_study_follows_from_the_evidence(name, tmp_path, undrawn):
    folder = tmp_path / name
    folder.mkdir()
    table = STUDIES[name](REPOSITORY, folder, VALUES)
    for file in sorted(path for path in folder.iterdir() if path.suffix != ".png"):
        assert_same_file(file, REPORTS / name / file.name)
    assert {path.name for path in folder.iterdir()} == {path.name for path in (REPORTS / name).iterdir()}
    table.to_csv(tmp_path / "table.csv", index=False, na_rep="" if name == "physics" else "nan")
    assert_same_file(tmp_path / "table.csv", REPORTS / OF_STUDIES[name])


@pytest.mark.parametrize("experiment", list(twins.MODULES))
def test_a_twin_is_inside_where_its_median_is_within_the_recorded_range(experiment):
    table, module = read(REPORTS / "twins.csv"), twins.MODULES[experiment]
    table = table[table["experiment"] == experiment]
    said = {row.statistic: (row.unit, row.meaning, row.note) for row in table.itertuples()}
    assert said == {name: (*about, module.NOTES.get(name, "")) for name, about in module.STATISTICS.items()}
    assert len(said) == len(table)
    inside = table["simulated"].between(table["recorded_low"], table["recorded_high"])
    assert list(inside) == list(table["inside"])
    for side in studies.SIDES:
        assert (table[side].between(table[f"{side}_low"], table[f"{side}_high"])).all()


def test_the_page_of_coverage_follows_from_its_tables(workspace):
    shutil.copytree(REPORTS / "coverage", workspace.reports / "coverage")
    page = workspace.reports / "coverage" / "README.md"
    page.unlink()
    coverage.write_page(workspace, VALUES)
    assert_same_file(page, REPORTS / "coverage" / "README.md")


def test_the_comparison_of_twins_follows_from_its_table(workspace, undrawn, tmp_path):
    shutil.copytree(REPORTS / "twins", workspace.reports / "twins")
    shutil.copy(REPORTS / "twins.csv", workspace.reports)
    for experiment in twins.MODULES:  # nothing was measured anew
        workspace.twins(experiment).parent.mkdir(parents=True)
        pd.DataFrame(columns=twins.COLUMNS).to_csv(workspace.twins(experiment), index=False)
    studies.twins(workspace, tmp_path, VALUES).to_csv(tmp_path / "twins.csv", index=False)
    assert_same_file(tmp_path / "twins.csv", REPORTS / "twins.csv")
    assert_same_file(tmp_path / "README.md", REPORTS / "twins" / "README.md")


def test_operations_and_parameters_are_counted_anew(tmp_path):
    counts.count(VALUES["glove"]["models"]["sp_resnet"]["reduction"], tmp_path / "counts.csv")
    assert_same_file(tmp_path / "counts.csv", REPORTS / "counts.csv")


def test_the_page_of_benchmarks_follows_from_its_tables(tmp_path):
    shutil.copytree(REPORTS / "benchmarks", tmp_path / "benchmarks")
    for name in ("benchmarks.csv", "growth.csv"):
        shutil.copy(REPORTS / name, tmp_path)
    (tmp_path / "benchmarks" / "README.md").unlink()
    benchmarks_report.write(tmp_path)
    assert_same_file(tmp_path / "benchmarks" / "README.md", REPORTS / "benchmarks" / "README.md")


def test_the_page_of_the_gallery_follows_from_its_scores():
    scores = pd.read_csv(REPORTS / "gallery" / "scores.csv", dtype={"test": str})
    assert gallery.report(scores) == (REPORTS / "gallery" / "README.md").read_text(encoding="utf-8")
    assert set(scores["name"]) == set(gallery.RECIPES)


PAGES = ("index.html", "appendix.html")


def test_the_reviewers_pages_follow_from_the_reports(workspace, undrawn):
    """But for the pictures in them, which other versions of libraries draw by other bytes."""
    for name in ("README.md", "constraints.txt"):
        shutil.copy(ROOT / name, workspace.root)
    for name in ("evidence", "docs", "dvc.yaml"):
        (workspace.root / name).symlink_to(ROOT / name)
    shutil.copytree(REPORTS, workspace.reports)
    (workspace.reports / "shards.md").unlink()
    found = sections.build(workspace, VALUES)
    assert tuple(found) == PAGES
    assert_same_file(workspace.reports / "shards.md", REPORTS / "shards.md")
    for name, page in found.items():
        committed = (REPORTS / name).read_text(encoding="utf-8")
        ours, theirs = (re.sub(r"data:image/[^\"]*", "", text) for text in (page, committed))
        assert ours == theirs, f"{name}: run `python -m pipeline.stages.page`"


# What the tests above compute anew: patterns of files of reports/, from what these tests run over.
ANEW = {
    *(
        "claims.csv",
        "claims.md",
        "twins.csv",
        "twins/README.md",
        "counts.csv",
        "benchmarks/README.md",
        "gallery/README.md",
        "shards.md",
        *PAGES,
    ),
    *(f"metrics/{name}/*" for name in VALUES["experiments"]),
    *(f"{name}/*/*.{kind}" for name in VALUES["experiments"] for kind in ("csv", "md")),
    *map(relative, [*TABLES, *SPEEDS]),
    *(f"{name}/*.{kind}" for name in STUDIES for kind in ("csv", "md")),
    *OF_STUDIES.values(),
    "coverage/README.md",
}
NOT_ANEW = {  # with the reason
    "*.png": "pictures: what they show are the tables, and libraries draw them by other bytes",
    "scores.csv": "trained: hours; tests/miniature.csv pins the same code at small scale",
    "latency.csv": "measured on one machine",
    "benchmarks.csv": "measured on one machine",
    "growth.csv": "measured on one machine",
    "benchmarks/*.csv": "measured on one machine",
    "coverage/*.csv": "of trained models and recordings",
    "sheet/*": "of recordings that not every machine has",
    "gallery/scores.csv": "of recordings that are downloaded one by one: a quarter of an hour",
    "targets/*": "of recordings that not every machine has: minutes",
    "material/fit.md": "of recordings that not every machine has: minutes",
}


def committed_files() -> list[str]:
    """Return the files of reports/ that git tracks; all of them where there is no git."""
    listed = subprocess.run(["git", "ls-files", "-z", "reports"], cwd=ROOT, capture_output=True, text=True).stdout
    found = [name.removeprefix("reports/") for name in listed.split("\0") if name]
    return found or [relative(path) for path in REPORTS.rglob("*") if path.is_file()]


def test_every_file_is_computed_anew_or_named_with_its_reason():
    files = committed_files()
    matched = {pattern: set(fnmatch.filter(files, pattern)) for pattern in [*ANEW, *NOT_ANEW]}
    anew = set().union(*(matched[pattern] for pattern in ANEW))
    named = set().union(*(matched[pattern] for pattern in NOT_ANEW))
    assert [name for name in files if name not in anew | named] == [], "compute it in a test, or say why not"
    assert [pattern for pattern in NOT_ANEW if not matched[pattern] - anew] == [], "no file needs this reason any more"
    assert len(anew) > 180 and all(NOT_ANEW.values())


INTERVALS = [path for path in sorted(REPORTS.rglob("*.csv")) if {"low", "high"} <= set(pd.read_csv(path, nrows=0))]
BOUNDS = {
    estimates.SHARE: (0.0, 1.0),
    estimates.LOG: (0.0, np.inf),
    estimates.R2: (-np.inf, 1.0),
    estimates.PLAIN: (-np.inf, np.inf),
}
WITH_INTERVALS = {"claims.csv", "rightsize.csv", "touch/accuracy/table1.csv", "glove/accuracy/table1.csv"}
EXACT = "physics.csv"  # of exact changes: an effect that a model cannot see changes nothing


def test_tables_with_intervals_are_there():
    assert {relative(path) for path in INTERVALS} >= WITH_INTERVALS


@pytest.mark.parametrize("path", [path for path in INTERVALS if path.name != EXACT], ids=relative)
def test_an_interval_has_width_and_stays_inside_its_bounds(path):
    table = pd.read_csv(path).dropna(subset=["low", "high"])
    assert (table["low"] < table["high"]).all(), table[table["low"] >= table["high"]].to_string()
    scale = table["metric"].map(estimates.scale_of) if "metric" in table else pd.Series(estimates.PLAIN, table.index)
    bounds = np.array([BOUNDS[each] for each in scale]).reshape(-1, 2)
    if "claim" in table:  # numbers that are judged say their unit alone
        percent = (table["kind"] == "number") & (table["unit"] == "%")
        explained = table["claim"].str.contains("(R2 below", regex=False)
        assert percent.any() and explained.any()
        bounds[percent], bounds[explained, 1] = (0, 100), 1
    outside = table[(table["low"] < bounds[:, 0]) | (table["high"] > bounds[:, 1])]
    assert outside.empty, outside.to_string()


@pytest.mark.parametrize("path", sorted([*REPORTS.rglob("*.md"), *REPORTS.glob("*.html")]), ids=relative)
def test_no_text_has_a_placeholder_or_broken_grammar(path):
    found = list(faults(path.read_text(encoding="utf-8")))
    assert not found, found


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("The difference spreads by - points.", True),
        ("about not counted seeds would be needed", True),
        ("split by session, 1 seeds", True),
        ("all 2 models stay usable", True),
        ("has the smallest images classified incorrectly", True),
        ("an interval of [nan, nan] kPa", True),
        ("| LoMP | not counted | - | 21 seeds, 1.1 points, failed (1 of 1 runs) | `nan` | banana |", False),
        ("<td>not counted</td><td>-</td>", False),
    ],
)
def test_what_a_placeholder_is(text, wrong):
    assert bool(faults(text)) == wrong
