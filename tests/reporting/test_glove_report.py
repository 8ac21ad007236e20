"""What the glove reports say must follow from the numbers, whatever they are."""

import copy
import json
import re
import sys

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet
import pytest
from scipy.stats import t as student

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.base.params import load
from pipeline.claims import entries, evidence, judge
from pipeline.datasets import images, schemas
from pipeline.reporting import glove as glove_report
from pipeline.reporting import sentences
from pipeline.reporting.claims import claim_sentence
from pipeline.scoring import claim_inputs, classification, glove_results, published, results
from pipeline.stages import render

JUDGED = re.compile(": (reproduced|contradicted|undecided|not testable)")

OBJECTS = ["empty_bottle", "full_bottle_1", "full_bottle_2", "mobile_phone", "paper_roll", "toy"]
SESSIONS, IMAGES = 5, 3  # of each object, of each session
LATENCY = {"batches": [1, 4], "threads": 1, "warm_up": 1, "calls": 5, "rounds": 1}
NETWORK = {"training": {"epochs": 2}}
MODELS = {"constant": {}, "naive_bayes": {}, "tree": {}, "resnet18": NETWORK, "mobilenet": NETWORK}
MODELS |= {"resnet3x3": NETWORK, "sp_resnet_nogcam": NETWORK, "sp_resnet": NETWORK}
SPEED = {f"speed/{name}" for name in ("table2.csv", "table2.md", "tradeoff.png", "training.png")}
COLUMNS = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    monkeypatch.setattr(paths, "REPORTS", tmp_path / "reports")
    return tmp_path


@pytest.fixture
def settings():
    """The block `glove` of params.yaml, made small."""
    block = copy.deepcopy(load()["glove"]) | {"latency": LATENCY, "models": MODELS}
    block["augmentation"] = {"model": "sp_resnet", "split": "session", "seeds": [0, 1]}
    for protocol in block["protocols"]:
        block["protocols"][protocol] = {"seeds": [0, 1] if protocol.startswith("session") else [0]}
    return block


def runs(settings):
    return [(name, seed) for name, block in settings["protocols"].items() for seed in block["seeds"]]


def write_experiment(experiment, settings):
    """Every file that the stages before `render` leave; a model's answers are right more often, the later it comes."""
    rng = np.random.default_rng(0)
    label = np.repeat(np.arange(len(OBJECTS)), SESSIONS * IMAGES)
    session = np.tile(np.repeat(np.arange(SESSIONS), IMAGES), len(OBJECTS))
    names = pa.array([OBJECTS[k] for k in label]).dictionary_encode()
    sessions = pa.array([f"session{k:02d}" for k in session]).dictionary_encode()
    columns = {"condition": names, "recording": sessions, "label": pa.array(label.astype(np.int16))}
    for dataset in images.MODALITIES:
        columns[dataset] = schemas.lists(
            rng.integers(0, 256, (len(label), images.SIDE**2)).astype(np.uint8), pa.uint8()
        )
    part = np.where(session < 2, "train", np.where(session < 3, "validation", "test"))
    for protocol, seed in runs(settings):
        columns[schemas.split_column(protocol, seed)] = pa.array(part.tolist()).dictionary_encode()
    data = pa.table(columns)
    schemas.write(paths.dataset(experiment), data.schema, [data])

    test = np.flatnonzero(part == "test")
    truth = np.eye(len(OBJECTS))[label[test]]
    scores, speed = [], []
    for place, model in enumerate(settings["models"]):
        parts = []
        for protocol, seed in runs(settings):
            predicted = place / 4 * truth + rng.uniform(size=truth.shape)
            parts.append(schemas.prediction_rows(protocol, seed, test, predicted))
            for row in classification.scores(truth, predicted):
                scores.append((experiment, protocol, images.modality(protocol), model, seed, *row))
            write_fit(experiment, model, protocol, seed, settings["models"][model])
        schemas.write(paths.predictions(experiment) / f"{model}.parquet", parts[0].schema, parts)
        speed += [
            (experiment, model, batch, 1, place + 0.1, place + 0.09, place + 0.11, place + 0.2, 45, 40, 6.5, 999)
            for batch in (1, 4)
        ]
    pd.DataFrame(scores, columns=COLUMNS).to_csv(paths.scores(experiment), index=False)
    names = ["experiment", "model", "batch", "threads", "p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms", "params"]
    names += ["macs", "train_s", "size_bytes"]
    for path in (paths.latency(experiment), paths.training_times(experiment, "any")):
        path.parent.mkdir(exist_ok=True)
    pd.DataFrame(speed, columns=names).to_csv(paths.latency(experiment), index=False)
    for place, model in enumerate(settings["models"]):
        times = pd.DataFrame([(*run, 0.1 + place) for run in runs(settings)], columns=["protocol", "seed", "train_s"])
        times.to_csv(paths.training_times(experiment, model), index=False)
    paths.ingest_report(experiment).write_text('{"run": true}')


def write_fit(experiment, model, protocol, seed, block):
    folder = paths.run_folder(experiment, model, protocol, seed)
    folder.mkdir(parents=True)
    epochs = block["training"]["epochs"] if "training" in block else 1
    history = {"epoch": range(1, epochs + 1), "train_loss": 3.0, "validation_loss": 4.0, "learning_rate": 1e-3}
    pd.DataFrame(history).to_csv(folder / "history.csv", index=False)
    reason = "completed" if "training" in block else "closed_form"
    fit = {"stop_reason": reason, "best_epoch": 1, "epochs": epochs, "parameters": 17}
    fit |= {"macs": 5, "precision": None, "settings": {}}
    (folder / "fit.json").write_text(json.dumps(fit))


def write_glove(settings):
    write_experiment("glove", settings)
    rng, n = np.random.default_rng(1), len(OBJECTS) * 4
    frames = pa.table(
        {
            "condition": pa.array(np.repeat(OBJECTS, 4).tolist()).dictionary_encode(),
            "recording": pa.array(["session00", "session01"] * (n // 2)).dictionary_encode(),
            "pressure": schemas.lists(rng.integers(0, 500, (n, 270)), pa.int16()),
            "strain": schemas.lists(rng.integers(1, 500, (n, 135)), pa.int16()),
        }
    )
    schemas.write(paths.frames("glove"), frames.schema, [frames])
    rows = [
        (method, f"session_{dataset}", dataset, seed, metric, "1", 0.5 + 0.1 * place + 0.01 * seed * (place + 1), 36)
        for place, method in enumerate(("none", "A", "B", "C"))
        for dataset in images.MODALITIES
        for seed in (0, 1)
        for metric in glove_report.METRICS
    ]
    names = ["method", "protocol", "condition", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(rows, columns=names).to_csv(paths.augmentation("glove"), index=False)
    (paths.experiment_folder("glove") / "stag.csv").write_text("form,model,seed,frames,metric,unit,value,n\n")
    trained_rows({"sp_resnet": [0.7, 0.8], "resnet3x3": [0.6, 0.75]}).to_csv(paths.input_frames("glove"), index=False)
    paths.REPORTS.mkdir()
    counts_table().to_csv(paths.REPORTS / "counts.csv", index=False)


def trained_rows(levels, first=2, form="trained"):
    """Rows of input_frames.csv; levels: model -> precision at `first` frames and on; seed 1: one point more."""
    rows = [
        (form, model, seed, frames, metric, "1", level + 0.01 * seed, 9)
        for model, values in levels.items()
        for frames, level in enumerate(values, first)
        for seed in (0, 1)
        for metric in glove_report.METRICS
    ]
    return pd.DataFrame(rows, columns=["form", "model", "seed", "frames", "metric", "unit", "value", "n"])


def counts_table(sp_resnet=30):
    """counts.csv: a published shape of two networks, and all like with like."""
    rows = [
        ("resnet18", "3x224x224", 1000, 1824033792, 11689512, 1824000000, 11690000, "reproduced", ""),
        ("sp_resnet", "1x32x32", 1000, 77, 88, 16332000, 326000, "contradicted", "reduction 16, as trained"),
        ("sp_resnet", "1x32x32", 1000, 78, 89, 16332000, 326000, "contradicted", "reduction 8"),
    ]
    costs = {"resnet18": 100, "mobilenet": 20, "resnet3x3": 200, "sp_resnet_nogcam": 10, "sp_resnet": sp_resnet}
    rows += [(model, "1x32x32", 16, cost, 10 * cost, np.nan, np.nan, "", "") for model, cost in costs.items()]
    names = ["model", "input_shape", "classes", "macs", "params", "published_macs", "published_params", "verdict"]
    table = pd.DataFrame(rows, columns=[*names, "note"]).replace("", np.nan)
    return table.assign(experiment="glove")


def run_render(experiment, settings, monkeypatch):
    """What `python -m pipeline.stages.render <experiment>` does."""
    monkeypatch.setattr(render.params, "load", lambda: {"experiments": [experiment], experiment: settings})
    monkeypatch.setattr(sys, "argv", ["render", experiment])
    render.main()
    return paths.REPORTS / experiment


@pytest.mark.slow
def test_glove_report_is_complete_and_its_tables_are_the_scores(root, settings, monkeypatch):
    write_glove(settings)
    target = run_render("glove", settings, monkeypatch)
    first = {path.relative_to(target).as_posix(): path.read_bytes() for path in target.rglob("*.*")}
    drawn = [
        "figure7",
        "figure9",
        "figure10",
        "figure13",
        *(f"figure14_{d}" for d in images.MODALITIES),
        "figure15",
        "learning_curves",
    ]
    assert set(first) == SPEED | {
        "accuracy/README.md",
        *(f"accuracy/{name}.{kind}" for name in ("table1", "table2") for kind in ("csv", "md")),
        "accuracy/figure15.csv",
        *(f"accuracy/{name}.png" for name in drawn),
    }
    latency = pd.read_csv(paths.latency("glove"))
    latency[["p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms"]] *= 1.5
    latency.to_csv(paths.latency("glove"), index=False)
    run_render("glove", settings, monkeypatch)
    assert {name for name in first if (target / name).read_bytes() != first[name]} == SPEED - {"speed/training.png"}

    scores = pd.read_csv(paths.scores("glove"))
    own = scores[(scores["model"] == "sp_resnet") & (scores["metric"] == "macro_precision")]
    values = 100 * own[own["protocol"] == "session_strain"]["value"]
    assert (values == 100).all()  # so that the interval is the exact binomial one of two runs out of two
    shown = f"100.00 [{100 * 0.025 ** (1 / 2):.2f}, 100.00]"
    (random,) = 100 * own[own["protocol"] == "random_frames_strain"]["value"]
    text = (target / "accuracy" / "table1.md").read_text()
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    assert [row[3:5] for row in lines if row[0] == "SP-ResNet" and len(row) == 7][0] == ["88.39", shown]
    (both,) = [row for row in lines if row[:2] == ["SP-ResNet", "strain"]]
    assert both[2:5] == ["88.39", shown, f"{random:.2f}"]
    assert "split is not stated" in text and "1,824,033,792" in text and "SP-ResNet (reduction 8)" in text
    counted = [row for row in lines if len(row) == 9 and row[0].startswith("SP-ResNet (reduction")]
    assert [row[-2:] for row in counted] == [["30", "300"], ["", ""]]  # like with like only as trained

    table = pd.read_csv(target / "accuracy" / "table1.csv").set_index(["protocol", "model", "metric"])
    assert table.loc[("session_strain", "sp_resnet", "macro_precision"), "mean"] == pytest.approx(values.mean() / 100)
    assert table.loc[("session_strain", "sp_resnet", "macro_precision"), "published"] == pytest.approx(0.8839)
    assert set(table[["runs", "failed"]].itertuples(index=False, name=None)) == {(2, 0), (1, 0)}
    table = pd.read_csv(target / "accuracy" / "table2.csv").set_index(["method", "condition", "metric"])
    assert table.loc[("all", "strain", "macro_precision"), "mean"] == pytest.approx(values.mean() / 100)
    half = student.ppf(0.975, 1) * 0.01 / 2  # gains of A: 0.1 and 0.11
    assert table.loc[("A", "pressure", "macro_precision"), "gain"] == pytest.approx(0.105)
    assert table.loc[("A", "pressure", "macro_precision"), "gain_low"] == pytest.approx(0.105 - half)
    readme = (target / "accuracy" / "README.md").read_text()
    assert "Of 45 runs trained in epochs, 45 went through their set number of epochs and 0 diverged" in readme
    assert "of Decision tree over that of Naive Bayes, combined" in readme and "published 0.387" in readme
    assert (
        "Training of SP-ResNet, 9 runs of 2 epochs: best epoch 1 (median; 1 to 1), with a validation loss of 4.00"
        in readme
    )
    assert "no file of it is named" in readme and "pipeline/models/lomp.py" not in readme


@pytest.mark.slow
def test_a_failed_run_is_shown_as_failed(root, settings, undrawn, monkeypatch):
    write_glove(settings)
    scores = pd.read_csv(paths.scores("glove"))
    scores.loc[(scores["model"] == "sp_resnet") & (scores["seed"] == 0), "value"] = np.nan
    scores.to_csv(paths.scores("glove"), index=False)
    path = paths.predictions("glove") / "sp_resnet.parquet"
    data = pyarrow.parquet.read_table(path)
    predicted = schemas.matrix(data["prediction"]).copy()
    predicted[data["seed"].to_numpy() == 0] = np.nan
    data = data.set_column(3, "prediction", schemas.lists(predicted, pa.float32()))
    schemas.write(path, data.schema, [data])
    target = run_render("glove", settings, monkeypatch)
    (row,) = [line for line in (target / "accuracy" / "table1.md").read_text().splitlines() if "SP-ResNet  " in line][
        :1
    ]
    assert row.count("failed (1 of 2 runs); others") == 3
    readme = (target / "accuracy" / "README.md").read_text()
    assert "Pressure: runs failed for SP-ResNet." in readme and "SP-ResNet is best" not in readme


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "named"),
    [
        (("scores.csv", "protocol", "random_frames_strain"), "no row for protocol random_frames_strain"),
        (("augmentation.csv", "method", "B"), "no row for method B, protocol session_pressure, seed 0"),
    ],
)
def test_a_missing_row_is_named(root, settings, undrawn, monkeypatch, change, named):
    write_glove(settings)
    name, column, value = change
    path = paths.experiment_folder("glove") / name
    rows = pd.read_csv(path)
    rows[rows[column] != value].to_csv(path, index=False)
    with pytest.raises(InputError, match=named):
        run_render("glove", settings, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("models", [["constant"], ["constant", "tree", "sp_resnet"]])
def test_models_can_be_left_out(root, settings, undrawn, monkeypatch, models):
    settings["models"] = {model: MODELS[model] for model in models}
    settings["augmentation"]["model"] = models[-1]
    settings["augmentation"]["seeds"] = [0]
    for block in settings["protocols"].values():
        block["seeds"] = [0]
    write_glove(settings)
    claim_inputs.rows("glove", settings).to_csv(paths.claim_inputs("glove"), index=False)
    target = run_render("glove", settings, monkeypatch)
    readme = (target / "accuracy" / "README.md").read_text()
    assert (
        "there is no macro_precision of ResNet-18 (session_combined, combined) in glove" in readme
        and "nan" not in readme
    )
    listed = {line.split("[")[1].split("]")[0] for line in readme.splitlines() if line.startswith("- [")}
    assert listed == {path.name for path in (target / "accuracy").glob("*.png")}
    if "sp_resnet" in models:
        assert "by session and" in readme and "reproduced." not in readme.split("## Confusions")[0]  # one seed


@pytest.mark.slow
def test_verdicts_of_the_report_are_those_of_the_claims(root, settings, undrawn, monkeypatch):
    write_glove(settings)
    claim_inputs.rows("glove", settings).to_csv(paths.claim_inputs("glove"), index=False)
    target = run_render("glove", settings, monkeypatch)
    claims = [claim for claim in entries.read()[0] if claim.experiment == "glove"]
    results = evidence.read(evidence.of_experiment("glove"))
    rows = judge.table(claims, evidence.Evidence(results, {"glove": settings}))
    lines = {claim_sentence(row) for row in rows.itertuples()}
    readme = (target / "accuracy" / "README.md").read_text()
    judged = {line for line in readme.splitlines() if line.startswith("- ") and JUDGED.search(line)}
    assert judged <= lines and len(judged) == 41
    assert {JUDGED.search(line)[0] for line in judged} == {
        f": {state}" for state in ("reproduced", "contradicted", "undecided", "not testable")
    }


def test_the_yardstick_is_the_ratio_of_wrong_answers(root, settings):
    """Fractions of wrong answers 0.2 and 0.4, whatever the seeds: the ratio is a half."""

    class Made:
        def runs(self, protocol, condition, model, metric):
            assert (protocol, condition) == ("random_frames_combined", "combined") and metric == "macro_precision"
            return [{"tree": 0.8, "naive_bayes": 0.6}[model], {"tree": 0.9, "naive_bayes": 0.8}[model]]

    assert sentences.error_ratio(Made(), settings["yardstick"])[:1] == pytest.approx((0.5,))
    printed = [100 - published.precision(model, "combined") for model in ("tree", "naive_bayes")]
    assert settings["yardstick"]["published"] == pytest.approx(printed[0] / printed[1], abs=5e-4)


def test_figure_15_has_both_forms_and_networks_of_several_frames_begin_with_one(root, settings):
    write_glove(settings)
    table = results.read_windows("glove")
    both = glove_results.read_frames(table, "combined", settings, ["sp_resnet"])
    assert set(both["model"]) == {"sp_resnet"}
    trained, mean = (both[both["form"] == form].drop(columns="form") for form in ("trained", "mean"))
    assert sorted(set(trained["frames"])) == sorted(set(mean["frames"])) == [1, 2, 3]
    key = ["model", "seed", "frames", "metric"]
    first = [rows[rows["frames"] == 1].set_index(key)["value"].sort_index() for rows in (trained, mean)]
    assert len(first[0]) == 4 and first[0].equals(first[1])
    several = trained.set_index(key)["value"]
    assert several["sp_resnet", 1, 3, "macro_precision"] == pytest.approx(0.81)
    assert set(glove_results.read_frames(table, "pressure", settings, ["sp_resnet"])["form"]) == {"mean"}
    # A network of one frame that was trained for the figure stands there itself, and nobody else's seeds do.
    trained_rows({"sp_resnet": [0.4, 0.7]}, 1).query("seed == 0").to_csv(paths.input_frames("glove"), index=False)
    both = glove_results.read_frames(table, "combined", settings, ["sp_resnet"])
    own = both[(both["form"] == "trained") & (both["metric"] == "accuracy")]
    assert own[["seed", "frames", "value"]].values.tolist() == [[0, 1, 0.4], [0, 2, 0.7]]


def test_scores_by_frames_are_those_of_the_mean_answer(root, settings):
    write_glove(settings)
    table = results.read_windows("glove")
    found = glove_results.scores_by_frames(table, "session_combined", settings, ["sp_resnet"])
    assert sorted(set(found["frames"])) == [1, 2, 3]  # sessions have three images
    predicted = results.read_predictions("glove", "sp_resnet", "session_combined", 1, table)
    test = np.isfinite(predicted).all(axis=1)
    means = predicted[test].reshape(-1, IMAGES, len(OBJECTS)).mean(axis=1)
    truth = np.eye(len(OBJECTS))[table["label"].to_numpy()[test][::IMAGES]]
    wanted = {metric: value for metric, _, value, _ in classification.scores(truth, means)}
    own = found[(found["seed"] == 1) & (found["frames"] == 3)].set_index("metric")["value"]
    assert own["accuracy"] == wanted["accuracy"] and own["macro_precision"] == wanted["macro_precision"]


@pytest.fixture
def recorded(settings):
    """The block `glove_recorded` of params.yaml, made small."""
    protocols = {f"grasp_{d}": {"seeds": [0, 1]} for d in images.MODALITIES}
    protocols |= {f"time_{d}": {"seeds": [0]} for d in images.MODALITIES}
    return load()["glove_recorded"] | {"latency": LATENCY, "models": MODELS, "protocols": protocols}


def write_probe(level):
    """Accuracy of two inputs for two seeds; `level`: of the joints that never move."""
    levels = {"all": 0.98, "still": level}
    rows = [(name, seed, "accuracy", "1", value, 9) for name, value in levels.items() for seed in (0, 1)]
    names = ["input", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(rows, columns=names).to_csv(paths.probe("glove_recorded"), index=False)


@pytest.mark.slow
def test_recorded_report(root, recorded, monkeypatch):
    write_experiment("glove_recorded", recorded)
    write_probe(0.8)
    target = run_render("glove_recorded", recorded, monkeypatch)
    found = {path.relative_to(target).as_posix() for path in target.rglob("*.*")}
    drawn = {f"accuracy/confusion_{d}.png" for d in images.MODALITIES} | {"accuracy/learning_curves.png"}
    written = {f"accuracy/{name}" for name in ("README.md", "table.csv", "table.md")}
    assert found == drawn | written | SPEED
    text = (target / "accuracy" / "table.md").read_text()
    assert text.count("| SP-ResNet  ") == 2 and "(`time`), 1 seed" in text
    table = pd.read_csv(target / "accuracy" / "table.csv")
    assert len(table) == 6 * len(MODELS) * 2 and "published" not in table


def test_published_tables_are_read():
    assert published.precision("sp_resnet", "combined") == 95.5 and published.precision("none", "strain") == 88.25
    models = (*published.PRINTED["sp_resnet"], *published.METHODS)
    assert np.isfinite([published.precision(model, dataset) for model in models for dataset in images.MODALITIES]).all()
    assert np.isnan(published.precision("constant", "strain"))
    assert glove_report.published_fusion("sp_resnet") == pytest.approx(4.33)
