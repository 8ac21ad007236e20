"""Reports of the stability tests: what they say follows from the evidence, and what it lacks is said."""

import itertools
import re

import numpy as np
import pandas as pd
import pytest
from builders import stress_rows
from builders.project import ROOT, run_stage

from pipeline.reporting import stability
from pipeline.reporting.figures import stability as figures
from pipeline.results import shards
from pipeline.stages import render_study
from tactile import experiments
from tactile.base import params
from tactile.drawing import labels

TESTS = {"noise": [0, 0.5, 1.0], "press_speed": [0, -2, -1, 1], "dead": [0, 6], "specimen": [0, 1, 2]}
SLOPES = {"constant": 0.0, "lomp": 2.0, "cnn": 10.0, "linear": 1.0}
CLEAN = {"constant": 10.0, "lomp": 2.0, "cnn": 3.0, "linear": 9.0}


def curve(model: str):
    """Errors of a made-up model: usable are 5 kPa."""
    return lambda severity, seed: CLEAN[model] + SLOPES[model] * (1 + seed / 50) * abs(severity)


@pytest.fixture
def made(workspace, monkeypatch):
    """Settings of touch and glove in a workspace without a shard, and the function that renders them."""
    values = params.load(ROOT / "params.yaml")
    values["experiments"] = ["touch", "glove"]
    values["touch"]["models"] = dict.fromkeys(CLEAN, {})
    values["stress"]["touch"] |= {"protocols": ["press"], "usable": {"press": 5.0}, "perturbations": TESTS}
    monkeypatch.setattr(params, "load", lambda _: values)
    stress_rows.copied_sets(workspace, ROOT)

    def render() -> str:
        run_stage(monkeypatch, workspace, render_study, "stability")
        return (workspace.reports / "stability" / "README.md").read_text()

    return values, render


def kept(workspace, place=("press", "double"), seeds=(0, 1, 2), **further) -> pd.DataFrame:
    """Keep the made-up models' scores as a shard, and return them."""
    rows = stress_rows.rows("touch", place, {model: curve(model) for model in CLEAN}, TESTS, seeds, **further)
    stress_rows.keep(workspace, "touch_press-0-full", rows)
    return rows


def cells(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]


def test_the_report_says_where_half_of_the_skill_is_lost(workspace, made, undrawn):
    rows = kept(workspace)
    text = made[1]()
    table = pd.read_csv(workspace.reports / "stability" / "failures.csv").set_index(
        ["perturbation", "direction", "model"]
    )
    assert not table.index.get_level_values("model").isin(["constant", "linear"]).any()
    assert table.loc[("noise", "up", "cnn"), "half_at"] == pytest.approx(3.5 / 10.2)
    assert table.loc[("noise", "up", "lomp"), "half_note"] == "> 1"
    assert table.loc[("press_speed", "down", "lomp"), "half_at"] == pytest.approx(-4 / 2.04)
    head = next(line for line in cells(text) if "Noise (share of the range)" in line)
    assert head == [
        *("Model", "Clean (kPa)", "Noise (share of the range)", "Speed of a press, above 0 (factor, as a power of 2)"),
        *("Speed of a press, below 0 (factor, as a power of 2)", "Dead elements (number of elements)"),
    ]
    row = next(line for line in cells(text) if line[0] == "CNN" and len(line) == len(head))
    assert row == ["CNN", "3.00", "0.34 [0.34, 0.35]", "0.34 [0.34, 0.35]", "-0.34 [-0.35, -0.34]", "< 1"]
    row = next(line for line in cells(text) if line[0] == "LoMP" and len(line) == len(head))
    assert row == ["LoMP", "2.00", "> 1", "> 1", "-2 [-2, -1.9]", "2 [1.9, 2]"]
    assert "Not usable clean (limit 5.00 kPa): Linear (9.00)." in text
    assert ["LoMP", "2.00", "5.06 [4.91, 5.21]"] in cells(text), "of other sensors the mean error"
    assert "Intervals are over 3 arrays.\n" in text and "intervals are over arrays, where there are 3 of them:" in text
    assert "split press, budget full, 3 seeds" in text and "touch_press_double.png" in text
    found = pd.read_csv(workspace.reports / "stress.csv")
    assert list(found.columns[:8]) == "experiment model seed perturbation severity metric unit value".split()
    assert len(found) == len(rows) and found["value"].tolist() == rows["value"].tolist()


def test_the_columns_that_others_read_come_first(workspace, made, undrawn):
    kept(workspace)
    made[1]()
    read = pd.read_csv(workspace.reports / "stability" / "failures.csv")
    first = (
        "experiment protocol condition perturbation model fails_at half_at half_low half_high all_at clean seeds budget"
    )
    assert list(read.columns[:13]) == first.split()
    assert read["clean"].notna().all() and (read["fails_at"] != 0).all()


def test_what_is_not_computed_is_said(workspace, made, undrawn):
    text = made[1]()
    assert "## Touch\n\nNot computed yet; `tactile evidence touch_press" in text
    assert "## Glove\n\nNot computed yet; `tactile evidence glove_session glove_session_networks" in text
    assert "How often does training fail?" in text and text.count("Not computed yet") == 3
    assert pd.read_csv(workspace.reports / "stress.csv").empty
    kept(workspace)
    made[0]["touch"]["models"] |= {"vgg": {}}
    made[0]["stress"]["touch"]["perturbations"] = TESTS | {"turn": [1]}
    text = made[1]()
    assert "Not computed yet: VGG-16, turned object." in text


def test_experiments_of_own_logs_are_not_told_of_by_the_evidence(workspace, made, undrawn):
    kept(workspace)
    made[0]["touch"]["source"] = "logs"
    text = made[1]()
    assert "## Touch\n\nThe logs are your own, and the evidence is of others." in text and "LoMP" not in text


def test_two_seeds_have_no_interval_and_the_report_names_them(workspace, made, undrawn):
    kept(workspace, seeds=(0, 1))
    text = made[1]()
    assert "There are no intervals, as the errors are of 2 arrays." in text and "Bands" not in text
    assert "2 seeds" in text and not re.search(r"\d \[", text.split("## Training")[0])


RECORDED = {  # experiment -> protocol and condition, persons, and what is said of one start, and of three
    "velostat_recorded": (("repetition", "all"), 1, "presses"),
    "strain_recorded": (("within_day_xy", "day_1"), 1, "presses"),
    "glove_recorded": (("grasp_pressure", "pressure"), 1, "grasps"),
    "array_recorded": (("fold_0", "two"), 2, "frames of 2 persons"),
}


@pytest.mark.parametrize("starts", [1, 3])
@pytest.mark.parametrize("experiment", RECORDED)
def test_below_a_table_stands_what_its_intervals_are_over(experiment, starts, workspace, made, monkeypatch):
    (place, persons, over), drawn = RECORDED[experiment], []
    monkeypatch.setattr(figures, "small_multiples", lambda path, panels, *rest: drawn.extend(panels))
    share, slopes = experiment == "glove_recorded", np.linspace(0.6, 1.4, 5)
    losses = {
        "constant": lambda at, seed: [[0.1 if share else 16.0] * 5] * persons,
        "linear": lambda at, seed: [0.9 - 0.3 * at * slopes if share else 1 + 10 * at * slopes] * persons,
    }
    values, render = made
    values["experiments"] = [experiment]
    values["stress"][experiment]["usable"] = {place[0]: 9.0}
    tests = {"noise": [0, 0.5, 1.0, 2.0], "jitter": [0, 0.5, 1.0, 2.0]}
    rows = stress_rows.by_blocks(experiment, place, losses, tests, range(starts))
    stress_rows.keep(workspace, f"{experiment}-0-full", rows)
    text = render()
    thing = experiments.facts(experiment).seeds.removesuffix("s")
    runs = f"of 1 {thing}" if starts == 1 else f"the mean of 3 {thing}s"
    assert f"Intervals are over {over}; each error is {runs}.\n" in text
    (row,) = (line for line in cells(text) if line[0] == "Linear")
    assert all(re.fullmatch(r"[\d.]+ \[[\d.]+, [\d.]+\]", cell) for cell in row[2:]), row
    read = pd.read_csv(workspace.reports / "stability" / "failures.csv")
    assert set(read["over"]) == {over} and read.columns[-1] == "over"
    bands = drawn[0].curves["linear"]
    assert (bands.low[1:] < bands.mean[1:]).all() and (bands.mean[1:] < bands.high[1:]).all()
    assert "Bands: 95 % intervals" in text and "cannot tell" not in text
    rows.loc[rows["perturbation"] == "jitter", "blocks"] = ""
    stress_rows.keep(workspace, f"{experiment}-0-full", rows)
    words = [labels.perturbation(name)[0] for name in tests]
    other = f"over {over} under {words[0]}, and over 3 {thing}s under {words[1]}" if starts == 3 else f"over {over}"
    assert f"Intervals are {other}; each error is {runs}.\n" in (text := render())
    stress_rows.keep(workspace, f"{experiment}-0-full", rows.assign(blocks="").drop(columns="blocks"))
    said = (
        f"There are no intervals, as the errors are of 1 {thing}." if starts == 1 else f"Intervals are over 3 {thing}s."
    )
    assert said in (text := render()) and ("Bands: 95 %" in text) == (starts == 3)


def test_a_test_of_one_severity_has_a_cell_and_no_panel(workspace, made, monkeypatch):
    drawn = []
    monkeypatch.setattr(figures, "small_multiples", lambda path, panels, *rest: drawn.extend(panels))
    kept(workspace)
    made[1]()
    assert [panel.title for panel in drawn] == ["Noise", "Speed of a press"]
    (half,) = drawn[0].curves["cnn"].half
    assert half == pytest.approx((3.5 / 10.2, 6.5)) and list(drawn[0].curves) == ["lomp", "cnn"]
    assert drawn[1].curves["lomp"].severities.tolist() == [-2, -1, 0, 1]


def test_figures_are_drawn_to_the_scale_of_severities(workspace, made, monkeypatch):
    axes = []
    monkeypatch.setattr(figures.style, "save", lambda figure, path: axes.extend(figure.axes))
    kept(workspace)
    made[1]()
    speed = next(ax for ax in axes if ax.get_title() == "Speed of a press")
    assert speed.get_xticks().tolist() == [-2, -1, 0, 1] and speed.get_xscale() == "linear"
    assert speed.lines[0].get_xdata().tolist() == [-2, -1, 0, 1]
    curves = {"lomp": figures.Curve(*np.full((4, 3), [0, 0.01, 1.0]), [])}
    panel = figures.Panel("Noise", "share", "log", curves, figures.Floor(*np.full((2, 3), [0, 0.01, 1.0])))
    axes.clear()
    figures.small_multiples(workspace.reports / "x.png", [panel], 1.0, "Error", "Title")
    (ax,) = (ax for ax in axes if ax.get_title() == "Noise")
    assert ax.get_xscale() == "symlog" and ax.get_xticks().tolist() == [0, 0.01, 1.0]


def test_training_with_faults_stands_beside_the_plain_one(workspace, made, undrawn):
    kept(workspace)
    robust = {"lomp": lambda severity, seed: 2.5 + 1.0 * abs(severity)}
    rows = stress_rows.rows("touch", ("press", "double"), robust, TESTS, (0, 1, 2), variant="faults")
    stress_rows.keep(workspace, "touch_press_faults-0-full", rows)
    text = made[1]()
    helped = pd.read_csv(workspace.reports / "stability" / "helped.csv").set_index(["perturbation", "direction"])
    assert helped.loc[("dead", "up"), "ratio"] == pytest.approx(3.75 / (4 / 2.04))
    told = {line[3]: line for line in cells(text) if line[:2] == ["Touch, two touches", "LoMP"]}
    assert set(told) == {
        "Dead elements (number of elements)",
        "Speed of a press, below 0 (factor, as a power of 2)",  # of noise neither loses half
    }
    assert told["Dead elements (number of elements)"][2:] == [
        *("2.00 / 2.50 kPa", "Dead elements (number of elements)", "2 [1.9, 2]", "3.8 [3.8, 3.8]", "1.91", "arrays")
    ]
    slower = told["Speed of a press, below 0 (factor, as a power of 2)"]
    assert slower[4:] == ["-2 [-2, -1.9]", "< -2", "> 1.02", "arrays"], "2 over 4 / 2.04"
    failures = pd.read_csv(workspace.reports / "stability" / "failures.csv")
    assert failures.loc[failures["model"] == "lomp", "clean"].unique().tolist() == [2.0]


def test_failing_starts_are_a_table(workspace, made, undrawn):
    rows = kept(workspace)
    results = rows[(rows["severity"] == 0) & (rows["perturbation"] == "noise")].copy()
    results.loc[(results["model"] == "cnn") & (results["seed"] == 2), "value"] = np.nan
    stress_rows.keep(workspace, "touch_press-0-full", rows, results)
    text = made[1]()
    starts = [line for line in cells(text) if line[0] == "Touch" and line[1] == "CNN"]
    assert starts == [["Touch", "CNN", "3", "1 (33 %)", "0 (0 %)", "not computed", "not computed", "-"]]


SENTENCE = re.compile(r"[A-Z].*[^ .,;(]\.")
BROKEN = re.compile(r" [,.;]|  |\(\)|\bnan\b|\binf\b|None|\{|, and \.|\b1 models|\ball 2\b|\bAll 2\b|, ,|and,")


@pytest.mark.parametrize("models", [1, 2, 3, 4])
@pytest.mark.parametrize("seeds", [1, 3])
def test_sentences_are_whole_for_any_outcome(models, seeds, workspace, made, undrawn, monkeypatch):
    """Each model keeps or loses half of its skill under each of two tests: patterns of up to four models."""
    names = ["lomp", "cnn", "rnn", "rbf"][:models]
    monkeypatch.setattr(stability.verdicts, "DRAWS", 10)
    seen = set()
    for pattern in list(itertools.product([0.1, 9.0], repeat=2 * models))[:: {3: 13, 4: 51}.get(models, 1)]:
        slopes = {name: pattern[2 * k : 2 * k + 2] for k, name in enumerate(names)}

        def error(severity, seed, name="", test=0, slopes=slopes):
            return 2.0 + names.index(name) / 10 + slopes[name][test] * abs(severity) * (1 + seed / 100)

        tables = [stress_rows.rows("touch", ("press", "double"), {"constant": lambda at, seed: 10.0} | {
            name: (lambda at, seed, name=name, test=test: error(at, seed, name, test)) for name in names
        }, {key: [0, 0.5, 1.0]}, tuple(range(seeds))) for test, key in enumerate(("noise", "jitter"))]  # fmt: skip
        runs = stability.verdicts.runs(pd.concat(tables), "touch")
        clean = stability.verdicts.clean_errors(tables[0][:0], runs, "touch")
        rows, out = stability.verdicts.failures(runs, clean, "touch", {"press": 5.0})
        said = stability.findings("touch", "press", "double", runs, rows, out)
        assert list(said) == ["breaks", "holds", "take"]
        for sentence in said.values():
            assert SENTENCE.fullmatch(sentence) and not BROKEN.search(sentence), sentence
        lost = [name for name in names if slopes[name][0] > 1 or slopes[name][1] > 1]
        assert ("Nothing breaks" in said["breaks"]) == (not lost)
        seen.add((said["breaks"][:30], said["holds"][:20], said["take"][:25]))
    assert len(seen) > 2


def test_the_sentences_are_right(workspace, made, undrawn):
    kept(workspace)
    made[1]()
    (row,) = pd.read_csv(workspace.reports / "stability" / "findings.csv").to_dict("records")
    assert row["breaks"] == (
        "What breaks first (two touches) is dead elements, under which both models lose half of their skill, CNN "
        "first, at less than one, and LoMP last, at 2 [1.9, 2] (number of elements)."
    )
    assert row["holds"] == (
        "No test leaves every model more than half of its skill; the one that most models withstand is "
        "speed of a press (up to 1), with 1 of 2."
    )
    assert row["take"] == (
        "Take LoMP everywhere, as its clean error is the least, 2.00 kPa, and where it has lost half of its skill no "
        "other model has clearly less error."
    )


def test_no_usable_model_is_one_sentence(workspace, made, undrawn):
    kept(workspace)
    made[0]["stress"]["touch"]["usable"] = {"press": 1.0}
    text = made[1]()
    assert (
        "No model is usable even before anything is perturbed (two touches): the least error is 2.00 kPa, of LoMP, "
        "where the limit of use is 1.00 and a constant has 10.00." in " ".join(text.split())
    )
    assert pd.read_csv(workspace.reports / "stability" / "failures.csv").empty


def test_every_perturbation_and_effect_of_params_has_words():
    values = params.load(ROOT / "params.yaml")
    stressed = {name for block in values["stress"].values() for name in block["perturbations"]}
    effects = {name for key in values["physics"] for name in values[key]["simulate"]["effects"]}
    assert stressed <= set(labels.PERTURBATIONS) and effects <= set(labels.EFFECTS)


def test_sets_with_stress_are_of_every_experiment():
    sets = shards.read_sets(stability.Workspace(ROOT))
    assert {each.experiment for each in sets.values() if each.stress} == set(
        params.load(ROOT / "params.yaml")["experiments"]
    )
