"""The report of an array under several fingers pools persons over folds, names what is missing, and shows frames."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
import yaml
from builders import made_reports
from builders.made_reports import MADE
from builders.project import ROOT, indexed

from pipeline.claims import rules
from pipeline.reporting import array
from pipeline.reporting.figures import curves
from pipeline.reporting.report import Report
from pipeline.results import kept, shards
from tactile.base.params_file import copied
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.drawing import common
from tactile.drawing.labels import model_name

EXPERIMENT, FINER = "array_recorded", 1.1  # of a variant: its errors over those of the main table
SETTINGS = made_reports.settings_of(EXPERIMENT)
FOLDS = ["fold_0", "fold_1"]
NAMES = {"one": "one contact", "two": "two contacts", "three": "three contacts"}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a workspace with a shard of all folds, and one of a variant; the CNN's runs of seed 0 have failed."""
    workspace = Workspace(tmp_path_factory.mktemp("array"))
    copied(ROOT / "params.yaml", workspace.root)
    made_reports.write(workspace, EXPERIMENT, SETTINGS, "cnn")
    rows = pd.read_csv(shards.result_file(workspace, MADE), keep_default_na=False, na_values=["nan"])
    rows = rows[rows["protocol"].isin(FOLDS) & rows["model"].isin(["linear", "lomp"])]
    power = np.where(rows["metric"] == "rmse_of_unit", 2, np.where(rows["metric"] == "rmse", 1, 0))
    rows["value"] *= FINER**power
    rows["variant"] = ["finer/" + unit if unit else "finer" for unit in rows["variant"].fillna("")]
    rows.to_csv(shards.result_file(workspace, "finer-0-full"), index=False)
    indexed(workspace, "finer-0-full", EXPERIMENT, 0, shards.result_file(workspace, "finer-0-full"))
    path = shards.folder(workspace) / "shards.yaml"
    sets = {"made": yaml.safe_load(path.read_text())["made"]}
    sets["finer"] = {"like": "made", "variant": "finer", "models": ["linear", "lomp"], "protocols": FOLDS}
    sets["slow"] = {"like": "made", "models": ["vgg"], "protocols": FOLDS[:]}
    sets["coarser"] = {"like": "made", "variant": "coarser", "models": ["lomp"], "protocols": [*FOLDS]}
    path.write_text(yaml.safe_dump(sets, sort_keys=False))
    return workspace


@pytest.fixture(scope="module")
def report(made):
    return Report(made, EXPERIMENT, SETTINGS)


@pytest.fixture(scope="module")
def shown(made, tmp_path_factory):
    """Return the folder of the rendered report, and what was drawn: name of a figure -> arguments."""
    copy, drawn = Workspace(tmp_path_factory.mktemp("shown") / "array"), {}
    shutil.copytree(made.root, copy.root)
    with pytest.MonkeyPatch.context() as patch:
        made_reports.unplot(patch)
        for module, name in ((common, "maps"), (curves, "boxes")):
            patch.setattr(module, name, lambda path, *given, name=name: drawn.update({name: given}) or path.touch())
        return made_reports.rendered(copy, EXPERIMENT, SETTINGS, patch) / "accuracy", drawn


def section(text: str, heading: str) -> str:
    """Return what stands below a heading, up to the next one."""
    return re.split(r"^#+ ", text.split(f"# {heading}\n")[1], flags=re.MULTILINE)[0]


def cells(text: str) -> dict[str, list[str]]:
    """Return first cell -> the others of each row of a table, its header included."""
    lines = [[cell.strip() for cell in line.strip("| \n").split(" | ")] for line in text.splitlines() if "|" in line]
    return {first: others for first, *others in lines}


def frames_of(made, fold: str, model: str, condition: str) -> tuple[np.ndarray, np.ndarray]:
    """Return person and squared error of every tested frame of a condition, (n,), averaged over runs that are sound."""
    table = schemas.read(made.dataset(EXPERIMENT))
    predicted = schemas.read(made.predictions(EXPERIMENT) / f"{model}.parquet").to_pandas()
    predicted = predicted[(predicted["protocol"] == fold) & np.isfinite(predicted["prediction"].map(np.sum))]
    truth = schemas.matrix(table["y"])[predicted["window"]]
    square = np.square(np.stack(predicted["prediction"]) - truth).mean(axis=1)
    mean = pd.Series(square).groupby(predicted["window"].to_numpy()).mean()
    chosen = schemas.names(table["condition"])[mean.index] == condition
    return schemas.names(table["person"])[mean.index][chosen], mean.to_numpy()[chosen]


@pytest.mark.parametrize(("model", "condition"), [("linear", "one"), ("lomp", "two"), ("cnn", "three")])
def test_a_pooled_error_is_of_all_frames_of_all_persons(made, report, model, condition):
    person, square = map(np.concatenate, zip(*(frames_of(made, fold, model, condition) for fold in FOLDS), strict=True))
    assert sorted(set(person)) == ["P01", "P02", "P03", "P04"]
    found, exact = array.pooled(report, FOLDS, condition, model, "rmse"), np.sqrt(square.mean())
    assert found.low < exact < found.high and found.mean == pytest.approx(exact, rel=1e-5)
    by_person = [np.sqrt(square[person == name].mean()) for name in sorted(set(person))]
    assert min(by_person) - 1e-9 <= found.mean <= max(by_person) + 1e-9
    assert (found.runs, found.failed) == ((4, 2) if model == "cnn" else (6, 0))
    draws = report.results.draws(EXPERIMENT, FOLDS, condition, model, "rmse", "", "full")
    assert found[:3] == rules.interval(draws)[:3], "as a claim has it"


def test_a_metric_without_scores_by_unit_is_over_the_folds(report):
    found = array.pooled(report, FOLDS, "two", "lomp", "r2")
    folds = [report.results.runs(EXPERIMENT, fold, "two", "lomp", "r2").mean() for fold in FOLDS]
    assert found.mean == pytest.approx(np.mean(folds), abs=0.01) and np.isnan(found.low) and found.runs == 6
    assert np.isfinite(array.pooled(report, FOLDS, "two", "lomp", "sum_ratio").low), "by person"


def test_a_fold_that_was_not_computed_leaves_no_pooled_number(report):
    assert array.pooled(report, [*FOLDS, "fold_2"], "two", "lomp", "rmse") is array.NOTHING
    assert array.pooled(report, FOLDS, "two", "lomp", "rmse", "coarser") is array.NOTHING
    assert array.pooled(report, FOLDS, "two", "cnn", "rmse", "finer") is array.NOTHING


def test_the_main_table_has_every_model_and_says_what_has_no_time(shown):
    folder, _ = shown
    text = (folder / "README.md").read_text()
    main = cells(section(text, "RMSE"))
    assert main["Model"] == [f"{name.capitalize()}, 18 frames" for name in NAMES.values()]
    pooled = pd.read_csv(folder / "pooled.csv").fillna({"variant": ""})
    for model in SETTINGS["models"]:
        here = pooled[(pooled["model"] == model) & (pooled["metric"] == "rmse") & (pooled["protocols"] == "fold")]
        here = here[here["variant"] == ""].set_index("condition")
        for condition, cell in zip(NAMES, main[model_name(model)], strict=True):
            assert f"{here.loc[condition, 'mean']:.2f} [{here.loc[condition, 'low']:.2f}, " in cell
            assert cell.startswith("failed (2 of 6 runs)") == (model == "cnn")
    assert main["ConvLSTM"] == main["RNN"] == ["frames have no time"] * 3
    assert set(main) == {"Model", *map(model_name, SETTINGS["models"]), "ConvLSTM", "RNN"} | {
        key for key in main if set(key) == {"-"}
    }
    assert "The 2 folds are pooled" in text and "No frame of four or more contacts is tested" in text
    for heading in ("R2", "Touches found", "Sum of the map over the label's", "Error away from contacts"):
        assert "ConvLSTM" not in (rows := cells(section(text, heading))) and model_name("lomp") in rows


def test_variants_and_more_contacts_stand_over_the_main_table_draw_by_draw(shown, report):
    text = (shown[0] / "README.md").read_text()
    finer = cells(section(text, "`finer`"))
    assert finer["Model"][-1] == "Two contacts, over the main table"
    assert [row for row in finer if row in map(model_name, SETTINGS["models"])] == ["Linear", "LoMP"]
    assert finer["LoMP"][-1] == "1.10", "all draws have one ratio, so there is no interval"
    two = cells(section(text, "Fitted to one and two contacts"))
    draws = [
        report.results.draws(EXPERIMENT, folds, "two", "lomp", "rmse", "", "full")
        for folds in (["two_too_0", "two_too_1"], FOLDS)
    ]
    assert two["LoMP"][-1].startswith(f"{draws[0].iloc[0] / draws[1].iloc[0]:.2f} [")
    assert two["CNN"][-1].startswith("failed (4 of 12 runs); others 1.00 [")
    assert "Not computed: VGG-16 on fold 0, fold 1, variant `coarser`." in text and section(
        text, "`coarser`"
    ).strip().endswith("Not computed.")


def test_each_person_has_one_row_of_the_fold_that_tests_on_them(made, shown):
    folder, _ = shown
    rows = cells(section((folder / "README.md").read_text(), "By person"))
    assert rows["Person"] == ["Tested in", "Frames", "LoMP", "CNN", "Linear, whole array"]
    assert [rows[f"P0{k}"][:2] for k in (1, 2, 3, 4)] == [["fold 0", "12"], ["fold 0", "12"], ["fold 1", "12"],
                                                          ["fold 1", "12"]]  # fmt: skip
    table = pd.read_csv(folder / "persons.csv")
    assert len(table) == 12 and set(table["protocol"]) == set(FOLDS)
    for row in table.itertuples():
        person, square = frames_of(made, row.protocol, row.model, "two")
        exact = np.sqrt(square[person == row.person].mean())
        assert row.mean == pytest.approx(exact, rel=1e-5) and row.low < exact < row.high


def test_figures_show_the_frames_that_are_kept_and_their_own_maps(made, shown):
    (_, caption, names, readings, truth, maps, sensor, _), errors = shown[1]["maps"], shown[1]["boxes"][0]
    assert "full budget, first of 3 starts, test part of fold 0" in caption and "CC BY-NC-SA 4.0" in caption
    assert list(maps) == ["lomp", "cnn", "linear_array"] and sensor == SETTINGS["sensor"]
    assert [name.split("\n")[0] for name in names] == [words for words in NAMES.values() for _ in range(kept.MAPPED)]
    table = schemas.read(made.dataset(EXPERIMENT))
    y, x = (schemas.matrix(table[name]) for name in "yx")
    person = schemas.names(table["person"])
    for name, reading, label, lomp in zip(names, readings, truth, maps["lomp"], strict=True):
        (row,) = np.flatnonzero(
            (np.abs(x - reading) < 1e-3).all(axis=1) & (np.abs(y - label.ravel()) < 0.1).all(axis=1)
        )
        assert name.endswith(f"person {person[row]}") and person[row] in ("P01", "P02")
        np.testing.assert_allclose(lomp.ravel(), y[row] * 0.7, atol=0.3)  # the fifth model's made predictions
    assert np.isnan(maps["cnn"]).all(), "its first start failed"
    assert list(errors) == list(SETTINGS["models"])
    person, square = frames_of(made, "fold_0", "linear", "two")
    assert {name: len(values) for name, values in errors["linear"].items()} == dict.fromkeys(NAMES.values(), 24)
    np.testing.assert_allclose(np.sort(errors["linear"]["two contacts"]), np.sort(square), rtol=0.02)


def test_without_a_shard_all_that_is_missing_is_named(made, tmp_path, monkeypatch):
    workspace = Workspace(tmp_path / "array")
    shutil.copytree(made.root, workspace.root)
    (shards.folder(workspace) / "index.csv").unlink()
    shutil.rmtree(shards.folder(workspace) / "studies")
    made_reports.unplot(monkeypatch)
    target = made_reports.rendered(workspace, EXPERIMENT, SETTINGS, monkeypatch)
    text = (target / "accuracy" / "README.md").read_text()
    protocols = ", ".join(f"`{name}`" for name in SETTINGS["protocols"])
    assert f"Not computed: {protocols}, variant `finer`, variant `coarser`." in text
    assert section(text, "RMSE").strip() == section(text, "By person").strip() == "Not computed."
    assert not list(target.rglob("*.png")) and "Nothing of it was computed" in (target / "speed/table2.md").read_text()
    assert all(pd.read_csv(path).empty for path in target.rglob("*.csv")) and len(list(target.rglob("*.csv"))) == 3


def test_one_fold_that_is_missing_is_named_and_the_others_stand_alone(made, tmp_path, monkeypatch):
    workspace = Workspace(tmp_path / "array")
    shutil.copytree(made.root, workspace.root)
    settings = SETTINGS | {"protocols": SETTINGS["protocols"] | {"fold_2": {"seeds": []}}}
    made_reports.unplot(monkeypatch)
    text = (made_reports.rendered(workspace, EXPERIMENT, settings, monkeypatch) / "accuracy/README.md").read_text()
    assert "Not computed: `fold_2`, VGG-16 on fold 0, fold 1, variant `coarser`." in text
    assert section(text, "RMSE").strip() == "Not computed."
    by_fold = cells(section(text, "By fold"))
    assert by_fold["LoMP"][-1] == "not run" and by_fold["LoMP"][0] != "not run"


def test_the_scores_by_fold_are_those_of_the_results(shown, report):
    table = pd.read_csv(shown[0] / "table.csv")
    assert len(table) == 4 * 3 * len(SETTINGS["models"]) * len(array.UNITS)
    row = table[(table["protocol"] == "fold_1") & (table["model"] == "lomp") & (table["metric"] == "away_rmse")].iloc[1]
    assert row["mean"] == pytest.approx(report.estimate("fold_1", row["condition"], "lomp", "away_rmse").mean)


def test_frames_are_drawn_with_one_scale_and_each_map_s_error_below_it(tmp_path, monkeypatch):
    drawn, rng = [], np.random.default_rng(0)
    monkeypatch.setattr(common.style, "save", lambda figure, path: drawn.append(figure))
    truth, sensor = np.zeros((2, 4, 4)), {"rows": 2, "cols": 2, "pitch_mm": 9.6}
    maps = {"lomp": truth + np.array([3.0, 40.0])[:, None, None], "cnn": np.full((2, 4, 4), np.nan)}
    readings, of = rng.uniform(0, 300, (2, 4)), array.CONTACT
    common.maps(tmp_path / "a.png", "Frames", "of $x", ["a", "b"], readings, truth, maps, sensor, of)
    axes = np.array(drawn[0].axes[:8]).reshape(2, 4)
    assert [ax.get_title() for ax in axes[0]] == ["Reading", "Contact", "LoMP", "CNN"]
    assert [ax.get_xlabel() for ax in axes[:, 2]] == ["RMSE 3.0 %", "RMSE 40.0 %"]
    assert [ax.get_xlabel() for ax in axes[:, 3]] == ["failed", "failed"]
    assert {ax.images[0].get_clim() for ax in axes[:, 1:].flat} == {(0, 100)}
    assert len({ax.images[0].get_clim() for ax in axes[:, 0]}) == 1
    assert r"of \$x" in drawn[0].get_suptitle()
    common.style.plt.close("all")
