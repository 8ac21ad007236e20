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
from builders.project import ROOT
from scipy.stats import t as student

from pipeline.base.errors import InputError
from pipeline.base.params import load
from pipeline.claims import entries, evidence, judge
from pipeline.datasets import images, schemas
from pipeline.reporting import glove as glove_report
from pipeline.reporting import glove_recorded as glove_recorded_report
from pipeline.reporting import sentences
from pipeline.reporting.claims import claim_sentence
from pipeline.reporting.figures import glove as glove_figures
from pipeline.scoring import claim_inputs, classification, glove_results, one_table, published, results
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
def root(workspace):
    return workspace.root


@pytest.fixture
def settings():
    """The block `glove` of params.yaml, made small."""
    block = copy.deepcopy(load(ROOT / "params.yaml")["glove"]) | {"latency": LATENCY, "models": MODELS}
    block["augmentation"] = {"model": "sp_resnet", "split": "session", "seeds": [0, 1]}
    for protocol in block["protocols"]:
        block["protocols"][protocol] = {"seeds": [0, 1] if protocol.startswith("session") else [0]}
    return block


def runs(settings):
    return [(name, seed) for name, block in settings["protocols"].items() for seed in block["seeds"]]


def write_experiment(workspace, experiment, settings):
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
    schemas.write(workspace.dataset(experiment), data.schema, [data])

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
            write_fit(workspace, experiment, model, protocol, seed, settings["models"][model])
        schemas.write(workspace.predictions(experiment) / f"{model}.parquet", parts[0].schema, parts)
        speed += [
            (experiment, model, batch, 1, place + 0.1, place + 0.09, place + 0.11, place + 0.2, 45, 40, 6.5, 999)
            for batch in (1, 4)
        ]
    pd.DataFrame(scores, columns=COLUMNS).to_csv(workspace.scores(experiment), index=False)
    names = ["experiment", "model", "batch", "threads", "p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms", "params"]
    names += ["macs", "train_s", "size_bytes"]
    for path in (workspace.latency(experiment), workspace.training_times(experiment, "any")):
        path.parent.mkdir(exist_ok=True)
    pd.DataFrame(speed, columns=names).to_csv(workspace.latency(experiment), index=False)
    for place, model in enumerate(settings["models"]):
        times = pd.DataFrame([(*run, 0.1 + place) for run in runs(settings)], columns=["protocol", "seed", "train_s"])
        times.to_csv(workspace.training_times(experiment, model), index=False)
    workspace.ingest_report(experiment).write_text('{"run": true}')


def write_fit(workspace, experiment, model, protocol, seed, block):
    folder = workspace.run_folder(experiment, model, protocol, seed)
    folder.mkdir(parents=True)
    epochs = block["training"]["epochs"] if "training" in block else 1
    history = {"epoch": range(1, epochs + 1), "train_loss": 3.0, "validation_loss": 4.0, "learning_rate": 1e-3}
    pd.DataFrame(history).to_csv(folder / "history.csv", index=False)
    reason = "completed" if "training" in block else "closed_form"
    fit = {"stop_reason": reason, "best_epoch": 1, "epochs": epochs, "parameters": 17}
    fit |= {"macs": 5, "precision": None, "settings": {}}
    (folder / "fit.json").write_text(json.dumps(fit))


def write_glove(workspace, settings):
    write_experiment(workspace, "glove", settings)
    rng, n = np.random.default_rng(1), len(OBJECTS) * 4
    frames = pa.table(
        {
            "condition": pa.array(np.repeat(OBJECTS, 4).tolist()).dictionary_encode(),
            "recording": pa.array(["session00", "session01"] * (n // 2)).dictionary_encode(),
            "pressure": schemas.lists(rng.integers(0, 500, (n, 270)), pa.int16()),
            "strain": schemas.lists(rng.integers(1, 500, (n, 135)), pa.int16()),
        }
    )
    schemas.write(workspace.frames("glove"), frames.schema, [frames])
    rows = [
        (method, f"session_{dataset}", dataset, seed, metric, "1", 0.5 + 0.1 * place + 0.01 * seed * (place + 1), 36)
        for place, method in enumerate(("none", "A", "B", "C"))
        for dataset in images.MODALITIES
        for seed in (0, 1)
        for metric in glove_report.METRICS
    ]
    names = ["method", "protocol", "condition", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(rows, columns=names).to_csv(workspace.augmentation("glove"), index=False)
    (workspace.experiment_folder("glove") / "stag.csv").write_text("form,model,seed,frames,metric,unit,value,n\n")
    trained_rows({"sp_resnet": [0.7, 0.8], "resnet3x3": [0.6, 0.75]}).to_csv(
        workspace.input_frames("glove"), index=False
    )
    workspace.reports.mkdir()
    counts_table().to_csv(workspace.reports / "counts.csv", index=False)


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


def run_render(workspace, experiment, settings, monkeypatch):
    """What `python -m pipeline.stages.render <experiment>` does."""
    monkeypatch.setattr(render.params, "load", lambda _: {"experiments": [experiment], experiment: settings})
    monkeypatch.setattr(sys, "argv", ["render", experiment])
    render.main(workspace)
    return workspace.reports / experiment


@pytest.mark.slow
def test_glove_report_is_complete_and_its_tables_are_the_scores(workspace, root, settings, monkeypatch):
    write_glove(workspace, settings)
    target = run_render(workspace, "glove", settings, monkeypatch)
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
    latency = pd.read_csv(workspace.latency("glove"))
    latency[["p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms"]] *= 1.5
    latency.to_csv(workspace.latency("glove"), index=False)
    run_render(workspace, "glove", settings, monkeypatch)
    assert {name for name in first if (target / name).read_bytes() != first[name]} == SPEED - {"speed/training.png"}

    scores = pd.read_csv(workspace.scores("glove"))
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
def test_stag_is_drawn_where_there_is_a_file(workspace, root, settings, undrawn, monkeypatch):
    write_glove(workspace, settings)
    levels = {"sp_resnet": np.linspace(0.6, 0.74, 8), "resnet3x3": np.linspace(0.5, 0.64, 8)}
    low = trained_rows({model: values - 0.3 for model, values in levels.items()}, 1, "mean")
    rows = pd.concat([trained_rows(levels, 1), low])
    rows.loc[(rows["model"] == "sp_resnet") & (rows["seed"] == 1), "value"] += 0.002
    half = student.ppf(0.975, 1) * 0.2 / 2  # of the differences, 10.0 and 10.2 points
    rows.to_csv(workspace.experiment_folder("glove") / "stag.csv", index=False)
    claim_inputs.rows(workspace, "glove", settings).to_csv(workspace.claim_inputs("glove"), index=False)
    target = run_render(workspace, "glove", settings, monkeypatch)
    assert (target / "accuracy" / "figure15_stag.png").exists()
    readme = (target / "accuracy" / "README.md").read_text()
    line = "SP-ResNet is above ResNet_3x3 at every number of input frames, STAG data set"
    assert f"- {line}: 10.10 [{10.1 - half:.2f}, {10.1 + half:.2f}] points: reproduced (weakest: " in readme


@pytest.mark.slow
def test_a_failed_run_is_shown_as_failed(workspace, root, settings, undrawn, monkeypatch):
    write_glove(workspace, settings)
    scores = pd.read_csv(workspace.scores("glove"))
    scores.loc[(scores["model"] == "sp_resnet") & (scores["seed"] == 0), "value"] = np.nan
    scores.to_csv(workspace.scores("glove"), index=False)
    path = workspace.predictions("glove") / "sp_resnet.parquet"
    data = pyarrow.parquet.read_table(path)
    predicted = schemas.matrix(data["prediction"]).copy()
    predicted[data["seed"].to_numpy() == 0] = np.nan
    data = data.set_column(3, "prediction", schemas.lists(predicted, pa.float32()))
    schemas.write(path, data.schema, [data])
    target = run_render(workspace, "glove", settings, monkeypatch)
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
def test_a_missing_row_is_named(workspace, root, settings, undrawn, monkeypatch, change, named):
    write_glove(workspace, settings)
    name, column, value = change
    path = workspace.experiment_folder("glove") / name
    rows = pd.read_csv(path)
    rows[rows[column] != value].to_csv(path, index=False)
    with pytest.raises(InputError, match=named):
        run_render(workspace, "glove", settings, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize(
    "missing", ["stag.csv", "augmentation.csv", "input_frames.csv", "predictions/resnet3x3.parquet"]
)
def test_a_missing_file_is_named(workspace, root, settings, undrawn, monkeypatch, missing):
    write_glove(workspace, settings)
    (workspace.experiment_folder("glove") / missing).unlink()
    with pytest.raises(InputError, match=f"data/glove/{missing}: not found"):
        run_render(workspace, "glove", settings, monkeypatch)


@pytest.mark.slow
def test_a_grasp_of_another_object_is_shown_where_there_is_no_phone(workspace, root, settings, undrawn, monkeypatch):
    titles = []
    monkeypatch.setattr(glove_report, "GRASPED", "telephone")
    monkeypatch.setattr(glove_figures, "tactile_images", lambda *given: titles.append(given[-1]))
    write_glove(workspace, settings)
    run_render(workspace, "glove", settings, monkeypatch)
    assert titles == ["Figure 10: tactile images, empty bottle, session00"]


@pytest.mark.slow
@pytest.mark.parametrize("models", [["constant"], ["constant", "tree", "sp_resnet"]])
def test_models_can_be_left_out(workspace, root, settings, undrawn, monkeypatch, models):
    settings["models"] = {model: MODELS[model] for model in models}
    settings["augmentation"]["model"] = models[-1]
    settings["augmentation"]["seeds"] = [0]
    for block in settings["protocols"].values():
        block["seeds"] = [0]
    write_glove(workspace, settings)
    claim_inputs.rows(workspace, "glove", settings).to_csv(workspace.claim_inputs("glove"), index=False)
    target = run_render(workspace, "glove", settings, monkeypatch)
    readme = (target / "accuracy" / "README.md").read_text()
    assert (
        "there is no macro_precision of ResNet-18 (session_combined, combined) in glove" in readme
        and "nan" not in readme
    )
    listed = {line.split("[")[1].split("]")[0] for line in readme.splitlines() if line.startswith("- [")}
    assert listed == {path.name for path in (target / "accuracy").glob("*.png")}
    if "sp_resnet" in models:
        assert "by session and" in readme and "reproduced." not in readme.split("## Confusions")[0]  # one seed


def written_scores(workspace, settings, values):
    """(scores, main protocols); values: (protocol, model) -> fraction a seed, 0.5 where it is not given."""
    rows = [
        ("glove", p, images.modality(p), model, seed, metric, "1", values.get((p, model), [0.5, 0.5])[seed], 9)
        for p, seed in runs(settings)
        for model in settings["models"]
        for metric in glove_report.METRICS
    ]
    workspace.scores("glove").parent.mkdir(parents=True)
    pd.DataFrame(rows, columns=COLUMNS).to_csv(workspace.scores("glove"), index=False)
    return results.Scores(workspace, "glove", settings), glove_results.main_protocols(settings)


def test_fusion_and_the_place_of_sp_resnet_are_compared_by_seed(workspace, root, settings):
    values = {
        ("session_pressure", "sp_resnet"): [0.90, 0.891],
        ("session_strain", "sp_resnet"): [0.7, 0.8],
        ("session_combined", "sp_resnet"): [0.95, 0.942],
        ("session_combined", "resnet18"): [0.97, 0.96],
    }
    scores, protocols = written_scores(workspace, settings, values)
    (line,) = glove_report.fusion_sentences(scores, settings, protocols)
    assert "SP-ResNet 5.05 [4.41, 5.69] (paper: 4.33)" in line and "Naive Bayes 0.00 (paper: -3.69)" in line
    (line,) = glove_report.place_sentences(scores, settings, protocols["combined"])
    assert "number 2 of 4 networks" in line and "ResNet-18 1.90 [0.63, 3.17], MobileNet -44.60" in line
    assert glove_report.place_sentences(scores, settings | {"models": {"sp_resnet": {}}}, protocols["combined"]) == []


@pytest.mark.slow
def test_verdicts_of_the_report_are_those_of_the_claims(workspace, root, settings, undrawn, monkeypatch):
    write_glove(workspace, settings)
    claim_inputs.rows(workspace, "glove", settings).to_csv(workspace.claim_inputs("glove"), index=False)
    target = run_render(workspace, "glove", settings, monkeypatch)
    claims = [claim for claim in entries.read(workspace)[0] if claim.experiment == "glove"]
    results = one_table.read(one_table.of_experiment(workspace, "glove"))
    rows = judge.table(claims, evidence.Evidence(workspace, results, {"glove": settings}))
    lines = {claim_sentence(row) for row in rows.itertuples()}
    readme = (target / "accuracy" / "README.md").read_text()
    judged = {line for line in readme.splitlines() if line.startswith("- ") and JUDGED.search(line)}
    assert judged <= lines and len(judged) == 41
    assert {JUDGED.search(line)[0] for line in judged} == {
        f": {state}" for state in ("reproduced", "contradicted", "undecided", "not testable")
    }


def test_best_order_and_optimism_follow_the_scores(workspace, root, settings):
    levels = {"naive_bayes": 0.9, "tree": 0.3, "resnet18": 0.8, "mobilenet": 0.7, "resnet3x3": 0.6, "sp_resnet": 0.65}
    values = {("session_strain", model): [level, level + 0.01] for model, level in levels.items()}
    values |= {("random_frames_strain", model): [level + 0.05] for model, level in levels.items()}
    values["random_frames_strain", "tree"] = [0.9]
    scores, protocols = written_scores(workspace, settings, values)
    strain = [
        line
        for found in (
            glove_report.best_sentences(scores, settings, protocols),
            glove_report.order_sentences(scores, settings, protocols),
            glove_report.optimism_sentences(scores, settings),
        )
        for line in found
        if "strain" in line.lower()
    ]
    best, order, optimism = strain[:3]
    assert "Naive Bayes is best with 90.50 [81.99, 95.23] %; not told apart from it: ResNet-18" in best
    assert "Order, strain: Naive Bayes, ResNet-18, MobileNet, SP-ResNet, ResNet_3x3" in order
    assert "0.00 (SP-ResNet (no GCAM)) to 59.50 points (Decision tree)" in optimism


def test_the_yardstick_is_the_ratio_of_wrong_answers(root, settings):
    """Fractions of wrong answers 0.2 and 0.4, whatever the seeds: the ratio is a half."""

    class Made:
        def runs(self, protocol, condition, model, metric):
            assert (protocol, condition) == ("random_frames_combined", "combined") and metric == "macro_precision"
            return [{"tree": 0.8, "naive_bayes": 0.6}[model], {"tree": 0.9, "naive_bayes": 0.8}[model]]

    assert sentences.error_ratio(Made(), settings["yardstick"])[:1] == pytest.approx((0.5,))
    printed = [100 - published.precision(model, "combined") for model in ("tree", "naive_bayes")]
    assert settings["yardstick"]["published"] == pytest.approx(printed[0] / printed[1], abs=5e-4)


def test_the_best_epochs_and_their_losses_are_medians_over_the_runs():
    def fit(best_epoch, losses, reason="completed"):
        history = pd.DataFrame({"epoch": range(1, len(losses) + 1), "validation_loss": losses})
        return results.Fit(reason, best_epoch, len(losses), 1, history)

    runs = [fit(2, [3.0, 0.5, 0.9]), fit(3, [2.0, 0.9, 0.3]), fit(3, [2.5, 0.9, 0.4])]
    failed = fit(0, [np.nan], "diverged")
    lines = glove_report.ending_sentences(
        {"sp_resnet": {"session_strain": runs[:2], "session_pressure": [runs[2], failed]}, "tree": {"any": [failed]}}
    )
    assert lines == [
        "- Training of SP-ResNet, 3 runs of 3 epochs: best epoch 3 (median; 2 to 3), with a validation loss of 0.40 "
        "(after one epoch 2.50)."
    ]


def confusions(confused, images_each=50):
    """Two runs of three datasets; confused: dataset -> (one, other) -> images of `one` that are named `other`."""
    found = {}
    for dataset in images.MODALITIES:
        counts = np.diag([images_each] * len(OBJECTS))
        for (one, other), number in confused.get(dataset, {}).items():
            i, j = OBJECTS.index(one), OBJECTS.index(other)
            counts[i, i] -= number
            counts[i, j] += number
        found[dataset] = np.array([counts, counts])
    return found


def test_pairs_are_found_by_name_in_both_directions():
    strain = {("full_bottle_1", "full_bottle_2"): 10, ("mobile_phone", "toy"): 3, ("toy", "empty_bottle"): 2}
    strain |= {("mobile_phone", "paper_roll"): 2, ("full_bottle_2", "empty_bottle"): 1}
    counts = confusions({"pressure": {("toy", "paper_roll"): 20, ("paper_roll", "toy"): 5}, "strain": strain})
    (paper,) = glove_report.pair_sentences(counts, OBJECTS, "pressure", ("paper_roll", "toy"))
    assert "`paper_roll` is named `toy` in 10.00 % of its images" in paper
    assert "`toy` `paper_roll` in 40.00 %. Combined: 0.00 % of both." in paper
    lines = glove_report.confused_sentences(counts, OBJECTS)
    assert lines[0].endswith("name): `paper_roll` and `toy` 25.00 %.")
    assert "`full_bottle_1` and `full_bottle_2` 10.00 %, `mobile_phone` and `toy` 3.00 %, " in lines[1]
    assert lines[2].endswith("no pair.")
    renamed = ["a", *OBJECTS[1:]]
    assert glove_report.pair_sentences(counts, renamed, "strain", ("empty_bottle", "toy")) == []


def test_the_lead_is_said_at_every_number_of_frames():
    table = trained_rows({"sp_resnet": [0.7, 0.8, 0.8], "resnet3x3": [0.6, 0.7, 0.75]}, 1)
    low = trained_rows({"sp_resnet": [0.5, 0.5], "resnet3x3": [0.3, 0.4]}, 1, "mean")
    line, mean = glove_report.frames_sentences("combined", pd.concat([low, table]))
    assert "1 to 3 input frames, one network trained on all frames, combined: SP-ResNet 70.50 [64.15, 76.85] to" in line
    assert "1 to 2 input frames, mean prediction of a one-frame network, combined: SP-ResNet 50.50" in mean
    assert "(points): 1: 10.00, 2: 10.00, 3: 5.00." in line
    assert glove_report.frames_sentences("STAG", table.iloc[:0]) == []


def test_figure_15_has_both_forms_and_networks_of_several_frames_begin_with_one(workspace, root, settings):
    write_glove(workspace, settings)
    table = results.read_windows(workspace, "glove")
    both = glove_results.read_frames(workspace, table, "combined", settings, ["sp_resnet"])
    assert set(both["model"]) == {"sp_resnet"}
    trained, mean = (both[both["form"] == form].drop(columns="form") for form in ("trained", "mean"))
    assert sorted(set(trained["frames"])) == sorted(set(mean["frames"])) == [1, 2, 3]
    key = ["model", "seed", "frames", "metric"]
    first = [rows[rows["frames"] == 1].set_index(key)["value"].sort_index() for rows in (trained, mean)]
    assert len(first[0]) == 4 and first[0].equals(first[1])
    several = trained.set_index(key)["value"]
    assert several["sp_resnet", 1, 3, "macro_precision"] == pytest.approx(0.81)
    assert set(glove_results.read_frames(workspace, table, "pressure", settings, ["sp_resnet"])["form"]) == {"mean"}
    # A network of one frame that was trained for the figure stands there itself, and nobody else's seeds do.
    trained_rows({"sp_resnet": [0.4, 0.7]}, 1).query("seed == 0").to_csv(workspace.input_frames("glove"), index=False)
    both = glove_results.read_frames(workspace, table, "combined", settings, ["sp_resnet"])
    own = both[(both["form"] == "trained") & (both["metric"] == "accuracy")]
    assert own[["seed", "frames", "value"]].values.tolist() == [[0, 1, 0.4], [0, 2, 0.7]]


def test_scores_by_frames_are_those_of_the_mean_answer(workspace, root, settings):
    write_glove(workspace, settings)
    table = results.read_windows(workspace, "glove")
    found = glove_results.scores_by_frames(workspace, table, "session_combined", settings, ["sp_resnet"])
    assert sorted(set(found["frames"])) == [1, 2, 3]  # sessions have three images
    predicted = results.read_predictions(workspace, "glove", "sp_resnet", "session_combined", 1, table)
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
    return load(ROOT / "params.yaml")["glove_recorded"] | {"latency": LATENCY, "models": MODELS, "protocols": protocols}


def write_probe(workspace, level):
    """Accuracy of two inputs for two seeds; `level`: of the joints that never move."""
    levels = {"all": 0.98, "still": level}
    rows = [(name, seed, "accuracy", "1", value, 9) for name, value in levels.items() for seed in (0, 1)]
    names = ["input", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(rows, columns=names).to_csv(workspace.probe("glove_recorded"), index=False)


@pytest.mark.slow
def test_recorded_report(workspace, root, recorded, monkeypatch):
    write_experiment(workspace, "glove_recorded", recorded)
    write_probe(workspace, 0.8)
    target = run_render(workspace, "glove_recorded", recorded, monkeypatch)
    found = {path.relative_to(target).as_posix() for path in target.rglob("*.*")}
    drawn = {f"accuracy/confusion_{d}.png" for d in images.MODALITIES} | {"accuracy/learning_curves.png"}
    written = {f"accuracy/{name}" for name in ("README.md", "table.csv", "table.md")}
    assert found == drawn | written | SPEED
    text = (target / "accuracy" / "table.md").read_text()
    assert text.count("| SP-ResNet  ") == 2 and "(`time`), 1 seed" in text
    table = pd.read_csv(target / "accuracy" / "table.csv")
    assert len(table) == 6 * len(MODELS) * 2 and "published" not in table


@pytest.mark.parametrize(
    ("pressure", "combined", "words"),
    [
        ((0.80, 0.802), (0.95, 0.96), ["75 % is reached (", "Pressure adds 5.00 points."]),
        ((0.70, 0.702), (0.85, 0.86), ["missed by 4.9 points (", "Pressure adds -5.00 points."]),
        (
            (0.70, 0.90),
            (0.90, 0.96),
            ["reached in the mean; the interval includes it", "Pressure adds 2.50 [-29.27, 34.27] points."],
        ),
    ],
)
def test_recorded_verdicts(workspace, root, recorded, pressure, combined, words):
    levels = {"grasp_pressure": pressure, "grasp_strain": (0.90, 0.91), "grasp_combined": combined}
    rows = [
        ("glove_recorded", p, images.modality(p), model, seed, metric, "1",
         levels.get(p, (0.5, 0.5))[seed] if model == "sp_resnet" else 0.3, 9)
        for p, seed in runs(recorded)
        for model in MODELS
        for metric in glove_report.METRICS
    ]  # fmt: skip
    workspace.scores("glove_recorded").parent.mkdir(parents=True)
    pd.DataFrame(rows, columns=COLUMNS).to_csv(workspace.scores("glove_recorded"), index=False)
    scores = results.Scores(workspace, "glove_recorded", recorded)
    best = glove_recorded_report.best_networks(scores, recorded)
    assert set(best.values()) == {"sp_resnet"}
    (alone,) = glove_recorded_report.pressure_sentences(scores, best, "grasp")
    (fusion,) = glove_recorded_report.fusion_sentences(scores, best, "grasp")
    assert words[0] in alone and words[1] in fusion
    write_probe(workspace, 0.625)
    reached, leak = glove_recorded_report.leak_sentences(
        scores, best, "grasp", glove_recorded_report.read_probe(workspace)
    )
    assert f"missed by {98 - 50 * sum(combined):.1f} points" in reached
    assert "all 98.0 %; still 62.5 %" in leak


def test_published_tables_are_read():
    assert published.precision("sp_resnet", "combined") == 95.5 and published.precision("none", "strain") == 88.25
    models = (*published.PRINTED["sp_resnet"], *published.METHODS)
    assert np.isfinite([published.precision(model, dataset) for model in models for dataset in images.MODALITIES]).all()
    assert np.isnan(published.precision("constant", "strain"))
    assert glove_report.published_fusion("sp_resnet") == pytest.approx(4.33)
