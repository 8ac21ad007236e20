"""Write what the stages before `render` leave of each experiment, small and made up, and render its report."""

import copy
import json
import shutil
import sys

import numpy as np
import pandas as pd
import pyarrow as pa
import yaml

from builders.project import ROOT, indexed, small_variants
from pipeline.reporting.figures import glove as glove_figures
from pipeline.reporting.figures import speed
from pipeline.reporting.figures import strain as strain_figures
from pipeline.reporting.figures import touch as touch_figures
from pipeline.results import claim_inputs, kept, one_table, shards
from pipeline.stages import render
from tactile import experiments
from tactile.base import params
from tactile.base.files import sha256, write_table
from tactile.base.params import load
from tactile.datasets import images, labels, schemas
from tactile.drawing import common
from tactile.experiments import array_recorded as array
from tactile.scoring import units as by_unit
from tactile.scoring.estimates import R2, SHARE, scale_of

TRAINING = {"training": {"epochs": 3}}
LATENCY = {"batches": [1, 4], "threads": 1, "warm_up": 1, "calls": 5, "rounds": 1}
SENSOR = {"rows": 3, "cols": 3, "pitch_mm": 12.0, "element_mm": 11.5}
LABEL = {"tip_radius_mm": 6.0, "map_rows": 12, "map_cols": 12}
TOUCHES = {"single": 1, "double": 2, "three": 3, "slide": 2, "tape": 5}  # condition -> touches at once
OBJECTS = ["empty_bottle", "full_bottle_1", "full_bottle_2", "mobile_phone", "paper_roll", "toy"]
SEEDS = (0, 1, 2)
SESSIONS, PICTURES = 5, 3  # of each object, of each session
NETWORKS = ("resnet18", "mobilenet", "resnet3x3", "sp_resnet_nogcam", "sp_resnet")
MODELS = {
    "touch": {"constant": {}, "linear": {}, "rnn": TRAINING, "lomp": TRAINING},
    "velostat_recorded": {"constant": {}, "linear": {}, "rnn": TRAINING},
    "strain": {"constant": {}, "ridge": {}, "lstm_direct": TRAINING, "lstm_transfer": {}, "lstm_transfer_ridge": {}},
    "strain_recorded": {"constant": {}, "press_difference": {}, "lstm_direct": TRAINING, "lstm_highpass": TRAINING},
    "array_recorded": {"constant": {}, "linear": {}, "linear_array": {}, "cnn": TRAINING, "lomp": TRAINING},
    "glove": {"constant": {}, "naive_bayes": {}, "tree": {}} | dict.fromkeys(NETWORKS, TRAINING),
}
MODELS["glove_recorded"] = MODELS["glove"]
MADE = "made-0-full"
CURVES = ["model", "protocol", "seed", "epoch", "train_loss", "validation_loss"]
SCORES = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
UNITS = {"rmse": "kPa", "error": "mm", "press_error": "mm", "peak_error": "kPa", "location_error": "mm"}


def settings_of(experiment: str) -> dict:
    """Return the block of an experiment of params.yaml, made small."""
    block = copy.deepcopy(load(ROOT / "params.yaml")[experiment])
    block |= {"latency": LATENCY, "models": copy.deepcopy(MODELS[experiment])}
    all_, one = {"seeds": list(SEEDS)}, {"seeds": [0]}
    if experiment == "touch":
        block |= {
            "sensor": SENSOR,
            "label": LABEL,
            "protocols": {"press": all_, "random_window": one | {"passes": 1}},
        }
        block["window"] = block["window"] | {"frames": 2}
        block["yardstick"] = block["yardstick"] | {"model": "rnn", "protocol": "press", "published": 0.25}
    elif experiment == "velostat_recorded":
        block["protocols"] = dict.fromkeys(("repetition", "tip_force_5", "tip_force_10"), all_)
    elif experiment == "array_recorded":
        block |= {"sensor": SENSOR | {"pitch_mm": 9.6}, "label": {"map_rows": 12, "map_cols": 12}}
        block["protocols"] = dict.fromkeys(("fold_0", "fold_1", "two_too_0", "two_too_1"), all_)
    elif experiment == "strain":
        block["protocols"] = dict.fromkeys(("task_1", "task_2", "task_0"), all_)
    elif experiment == "strain_recorded":
        block["protocols"] = dict.fromkeys(("within_day_xy", "across_days_xy", "within_day_z", "within_day_xyz"), all_)
    elif experiment == "glove":
        for protocol in block["protocols"]:
            block["protocols"][protocol] = all_ if protocol.startswith("session") else one
    else:
        block["protocols"] = {f"grasp_{d}": all_ for d in images.MODALITIES}
        block["protocols"] |= {f"time_{d}": one for d in images.MODALITIES}
    return block


def made_score(settings: dict, model: str, seed: int, metric: str, condition: str) -> float:
    """Return a score that is better the later the model comes, tenfold on double touch; no two seeds have one."""
    place = list(settings["models"]).index(model)
    if scale_of(metric) in (R2, SHARE):
        return round(0.4 + 0.06 * place + 0.01 * seed, 3)
    return (10.0 * (len(settings["models"]) - place) + seed) * (10 if condition == "double" else 1)


def write(workspace, experiment: str, settings: dict, failed: str = "") -> None:
    """Write all files of an experiment that its report reads; failed: a model whose runs of seed 0 failed."""
    data, part_of, truth, metrics = DATA[experiment](workspace, settings)
    part_of = part_of if callable(part_of) else lambda protocol, part=part_of: part
    runs = [(name, seed) for name, block in settings["protocols"].items() for seed in block["seeds"]]
    for protocol, seed in runs:
        column = pa.array(part_of(protocol).tolist()).dictionary_encode()
        data = data.append_column(schemas.split_column(protocol, seed), column)
    schemas.write(workspace.dataset(experiment), data.schema, [data])
    scores, speed, rng = [], [], np.random.default_rng(0)
    for path in (workspace.latency(experiment), workspace.training_times(experiment, "any")):
        path.parent.mkdir(exist_ok=True)
    for place, (model, block) in enumerate(settings["models"].items()):
        parts = []
        for protocol, seed in runs:
            test = np.flatnonzero(part_of(protocol) == "test")
            predicted = truth[test] * (0.5 + 0.05 * place) + 0.1 * rng.uniform(size=truth[test].shape)
            lost = model == failed and seed == 0
            predicted[:] = np.nan if lost else predicted
            parts.append(schemas.prediction_rows(protocol, seed, test, predicted))
            write_fit(workspace, experiment, model, protocol, seed, block)
            for condition, names in metrics(protocol).items():
                for metric in names:
                    value = np.nan if lost else made_score(settings, model, seed, metric, condition)
                    scores.append(
                        (experiment, protocol, condition, model, seed, metric, UNITS.get(metric, "1"), value, 9)
                    )
        schemas.write(workspace.predictions(experiment) / f"{model}.parquet", parts[0].schema, parts)
        speed += [(experiment, model, b, 1, 0.5, 0.4, 0.6, 0.75, 12345, None, 6.5, 999) for b in LATENCY["batches"]]
        times = pd.DataFrame([(*run, 6.5 + place) for run in runs], columns=["protocol", "seed", "train_s"])
        times.to_csv(workspace.training_times(experiment, model), index=False)
    pd.DataFrame(scores, columns=SCORES).to_csv(workspace.scores(experiment), index=False)
    names = "experiment model batch threads p50_ms p50_low_ms p50_high_ms p95_ms params macs train_s size_bytes"
    pd.DataFrame(speed, columns=names.split()).to_csv(workspace.latency(experiment), index=False)
    log = {"lines": 99, "rate_hz": 50.0, "rejects": {"torn": 1}}
    ingested = {"run": True, "recordings": {"single/day_1": {"frames": 98, "files": {"array.log": log}}}}
    workspace.ingest_report(experiment).write_text(json.dumps(ingested))
    if experiments.facts(experiment).paper:
        rows = claim_inputs.rows(workspace, experiment, settings)
        rows = pd.concat([rows, augmented()]) if experiment == "glove" else rows
        rows.to_csv(workspace.claim_inputs(experiment), index=False)
    kept.write(workspace.kept(experiment), kept.table(workspace, experiment, settings))
    write_evidence(workspace, experiment, settings)


def write_evidence(workspace, experiment: str, settings: dict) -> None:
    """Keep what the stages left as the shard MADE of the evidence, too, of all seeds."""
    folder, files = shards.folder(workspace), one_table.of_experiment(workspace, experiment)
    rows = one_table.read({name: files[name] for name in ("scores", "claim_inputs")})
    rows = rows[rows["metric"] != "train_s"].fillna({"budget": ""}).replace({"budget": {"look": "full"}})
    if experiments.facts(experiment).subject:
        of_units = pd.DataFrame(by_unit.rows(workspace, experiment, settings, list(settings["protocols"])))
        rows = pd.concat([rows, of_units.assign(budget="full")])
    write_table(shards.result_file(workspace, MADE), rows[claim_inputs.COLUMNS].astype({"seed": "Int64"}), "nan")
    curves, times = [], []
    for place_of, (model, block) in enumerate(settings["models"].items()):
        for run in params.runs({experiment: settings}, experiment):
            history = pd.read_csv(workspace.run_folder(experiment, model, *run) / "history.csv")
            place = dict(zip(("protocol", "seed"), run, strict=True)) | {"model": model}
            curves.append(history.assign(**place)[: len(history) if "training" in block else 0])
            times.append({"shard": MADE, **place, "epochs": len(history), "train_s": 6.5 + place_of})
    write_table(folder / "curves" / f"{MADE}.csv", pd.concat(curves)[CURVES])
    shards.kept_file(workspace, MADE).parent.mkdir(exist_ok=True)
    shutil.copy(workspace.kept(experiment), shards.kept_file(workspace, MADE))
    line = {"shard": MADE, "experiment": experiment, "protocol": "made", "seed": 0, "budget": claim_inputs.FULL}
    line |= {"sha256": sha256(shards.result_file(workspace, MADE)), "machine": "a core", "commit": "0" * 40}
    line |= {"core_s": 1, "data_sha256": "", "kept_sha256": shards.kept_sha256(workspace, MADE)}
    shards.upsert(folder / "index.csv", shards.INDEX, MADE, [line])
    shards.upsert(folder / "times.csv", shards.TIMES, MADE, times)
    timed = shards.study_file(workspace, experiment, "latency", 0)
    write_table(timed, pd.read_csv(workspace.latency(experiment)).assign(calls=LATENCY["calls"]))
    line |= {"shard": f"latency_{experiment}-0-full", "protocol": shards.STUDY, "sha256": sha256(timed)}
    shards.upsert(folder / "index.csv", shards.INDEX, line["shard"], [line | {"kept_sha256": ""}])
    small_variants(workspace.root)
    sets = yaml.safe_load((folder / "shards.yaml").read_text())
    own = {"experiment": experiment, "data": "made up", "protocols": list(settings["protocols"]), "seeds": 3}
    (folder / "shards.yaml").write_text(yaml.safe_dump({**sets, "made": own | {"minutes": 1}}, sort_keys=False))


def write_fit(workspace, experiment: str, model: str, protocol: str, seed: int, block: dict) -> None:
    """Write how one run was trained."""
    folder = workspace.run_folder(experiment, model, protocol, seed)
    folder.mkdir(parents=True)
    epochs = block["training"]["epochs"] if "training" in block else 1
    losses = [9.0 / epoch for epoch in range(1, epochs + 1)]
    history = {"epoch": range(1, epochs + 1), "train_loss": losses, "validation_loss": [2 * loss for loss in losses]}
    pd.DataFrame(history | {"learning_rate": 1e-3}).to_csv(folder / "history.csv", index=False)
    fit = {"stop_reason": "completed" if epochs > 1 else "closed_form", "best_epoch": epochs, "epochs": epochs}
    fit |= {"parameters": 17, "macs": 5, "precision": None, "settings": block}
    (folder / "fit.json").write_text(json.dumps(fit))


def touch(workspace, settings: dict) -> tuple:
    """Write frames and variants of 12 windows a condition; return the dataset, its parts, truth, metrics."""
    rng, n = np.random.default_rng(0), 12 * len(TOUCHES)
    names = np.repeat(list(TOUCHES), 12)
    force, x, y = (np.full((n, 5), np.nan) for _ in range(3))
    for row, name in enumerate(names):
        force[row, : TOUCHES[name]] = rng.uniform(5, 40, TOUCHES[name])
        x[row, : TOUCHES[name]] = 1.5 + 3 * rng.integers(0, 12, TOUCHES[name])
        y[row, : TOUCHES[name]] = 1.5 + 3 * rng.integers(0, 12, TOUCHES[name])
    x[:12, 0], y[:12, 0] = np.tile([13.5, 16.5, 19.5, 22.5], 3), 16.5
    counts = rng.integers(0, 1023, (n, 18)).astype(np.int16)
    schema, frames = schemas.frames(9, 5, pa.int16()), []
    for name in TOUCHES:
        of = {"v": counts[:, -9:], "force_n": force, "x_mm": x, "y_mm": y}
        of = {key: np.repeat(values[names == name], 3, axis=0) for key, values in of.items()}
        rows = {"segment": np.zeros(36, int), "t_s": np.arange(36) * 0.02, **of}
        frames.append(schemas.frame_rows(schema, name, "run000", **rows))
    schemas.write(workspace.frames("touch"), schema, frames)
    truth = labels.pressure_maps(labels.pressure_kpa(force, 6.0), x, y, SENSOR, LABEL).reshape(n, -1)
    columns = {
        "condition": pa.array(names.tolist()).dictionary_encode(),
        "recording": pa.array(["run000"] * n).dictionary_encode(),
        "press": pa.array((np.arange(n) // 3).astype(np.int32)),
        "t_s": pa.array(np.tile(np.arange(12) * 0.16, len(TOUCHES))),
        "x": schemas.lists(counts, pa.int16()),
        "y": schemas.lists(truth, pa.float32()),
    }
    for name, values in (("force_n", force), ("x_mm", x), ("y_mm", y)):
        columns[name] = schemas.lists(values.astype(np.float32), pa.float32())
    ablated = [
        ("press", condition, model, name, "rmse", seed, "kPa", level + seed * (1 if name == "lomp_half" else 2))
        for name, model, level in (
            ("lomp_half", "lomp", 20.0),
            ("lomp_alpha_0", "lomp", 30.0),
            ("linear_1_frame", "linear", 93.0),
        )
        for condition in ("single", "double")
        for seed in (SEEDS if name != "linear_1_frame" else SEEDS[1:])
        if model in settings["models"]
    ]
    varied(workspace, "touch", ablated)
    part = np.where((names == "single") & (np.arange(n) % 12 < 4), "train", "test")
    metrics = ["rmse", "peak_error", "location_error", "touches_found", "force_error", "force_rmse", "force_r2", "r2"]
    return pa.table(columns), part, truth, lambda protocol: dict.fromkeys(TOUCHES, metrics)


def velostat_recorded(workspace, settings: dict) -> tuple:
    """Return the dataset of two recordings, each of two repetitions, its parts, truth, metrics."""
    names = np.repeat([f"{g}/{e}" for g in ("tip_force_5", "tip_force_10") for e in ("exp1", "exp2")], 30)
    force = 5 + 5 * np.sin(np.arange(len(names)) / 4)[:, None]
    columns = {
        "condition": pa.array([name.split("/")[0] for name in names]).dictionary_encode(),
        "recording": pa.array(names.tolist()).dictionary_encode(),
        "press": pa.array((np.arange(len(names)) // 10).astype(np.int32)),
        "t_s": pa.array(np.tile(np.arange(30) * 0.05, 4)),
        "x": schemas.lists(np.repeat(force, settings["window"]["frames"], axis=1), pa.float32()),
        **{name: schemas.lists(force, pa.float32()) for name in ("y", "force_n", "x_mm", "y_mm")},
    }
    pooled = dict.fromkeys(("all", "tip_force_5", "tip_force_10"), ["rmse", "r2"])
    part = np.where(np.char.endswith(names, "exp2"), "test", "train")
    return pa.table(columns), part, force, lambda p: pooled if p == "repetition" else {p: ["rmse", "r2"]}


def array_recorded(workspace, settings: dict) -> tuple:
    """Return the dataset of four persons, 12 frames of one, two and three contacts each, its parts, truth, metrics.

    A contact is 3 x 3 cells.
    """
    rng, names, each = np.random.default_rng(3), ("one", "two", "three"), 12
    person = np.repeat([f"P{k:02d}" for k in range(1, 5)], each * len(names))
    contacts = np.tile(np.repeat(np.arange(len(names)), each), 4) + 1
    side, pitch = settings["label"]["map_rows"], settings["sensor"]["pitch_mm"] * 3 / settings["label"]["map_rows"]
    truth, x, y = np.zeros((len(person), side, side)), *np.full((2, len(person), 3), np.nan)
    for row, number in enumerate(contacts):
        for k, place in enumerate(rng.permutation(9)[:number]):
            down, along = 4 * (place // 3), 4 * (place % 3)
            truth[row, down : down + 3, along : along + 3] = rng.uniform(60, 100)
            x[row, k], y[row, k] = (along + 1.5) * pitch, (down + 1.5) * pitch
    readings = truth.reshape(-1, 3, side // 3, 3, side // 3).mean(axis=(2, 4)).reshape(len(person), 9) * 5
    columns = {
        "condition": pa.array([names[k - 1] for k in contacts]).dictionary_encode(),
        "recording": pa.array([f"{name}/1" for name in person]).dictionary_encode(),
        "person": pa.array(person.tolist()).dictionary_encode(),
        "contacts": pa.array(contacts.astype(np.int8)),
        "press": pa.array(np.arange(len(person), dtype=np.int32)),
        "t_s": pa.array(np.arange(len(person), dtype=float)),
        "x": schemas.lists(readings, pa.float32()),
        **{name: schemas.lists(values, pa.float32()) for name, values in (("x_mm", x), ("y_mm", y))},
        "y": schemas.lists(truth.reshape(len(person), -1), pa.float32()),
    }
    table, metrics = pa.table(columns), ["rmse", "r2", "touches_found", "sum_ratio", "away_rmse"]
    part_of, scored = (lambda protocol: array.split(table, settings, protocol, 0)), dict.fromkeys(names, metrics)
    return table, part_of, truth.reshape(len(person), -1), lambda protocol: scored


def strain(workspace, settings: dict, experiment: str = "strain") -> tuple:
    """Write the studies; return the dataset of 80 samples, its parts, truth, metrics."""
    rng, n, recorded = np.random.default_rng(2), 80, experiment == "strain_recorded"
    conditions = ("day_1", "day_2") if recorded else ("task_0", "task_1", "task_2")
    truth = 10 * rng.uniform(-1, 1, (n, 3))
    columns = {
        "condition": pa.array([conditions[k % len(conditions)] for k in range(n)]).dictionary_encode(),
        "recording": pa.array(["run000"] * n).dictionary_encode(),
        "press": pa.array((np.arange(n) // 8 if recorded else np.full(n, -1)).astype(np.int32)),
        "t_s": pa.array(np.arange(n) * 20.0),
        "v": schemas.lists(rng.normal(size=(n, 7)), pa.float32()),
        "y": schemas.lists(truth, pa.float32()),
    }
    part = np.where(np.arange(n) < 40, "train", "test")
    if recorded:
        scored = {"xy": ["error", "r2_x", "r2_y", "press_error", "press_r2_x", "press_r2_y"], "z": ["error", "r2_z"]}
        scored["xyz"] = scored["xy"][:3]
        days = {"within_day": "day_1", "across_days": "day_2"}
        return pa.table(columns), part, truth, lambda p: {days[p.rsplit("_", 1)[0]]: scored[p.rsplit("_", 1)[1]]}
    pairs = [(task, seed) for task in ("task_1", "task_2") for seed in SEEDS]
    networks = {"lstm_direct": 2.0, "lstm_transfer": 3.0, "lstm_transfer_ridge": 3.5}
    rows = [
        (task, task, model, f"{name}_{x}", "error", seed, "mm", level + 100 / x + seed)
        for name, sizes in (("samples", (100, 1000)), ("strands", (2, 4)))
        for task, seed in pairs
        for model, level in networks.items()
        for x in sizes
    ]
    rows += [
        ("task_2", "task_2", model, f"base_{base}", "error", seed, "mm", 3.0 + seed)
        for model in list(networks)[1:]
        for base in ("task_0", "task_1")
        for seed in SEEDS
    ]
    for task, seed in pairs:
        for units in (5, 50):
            name, model = f"units_{units}", "lstm_direct"
            rows.append((task, task, model, name, "error", seed, "mm", 9.0 / units + seed))
            rows += [(task, "any", model, name, cost, seed, "1", n) for cost, n in (("params", 9), ("macs", 99))]
    varied(workspace, "strain", rows)
    inputs = {"raw voltages": 0.9, "latent of model-0": 0.5}
    rows = [
        (task, seen, target, seed, "r2", "1", level + 0.01 * seed)
        for task, seed in pairs
        for seen, level in inputs.items()
        for target in ("elapsed time", "true drift")
    ]
    header = ["protocol", "input", "target", "seed", "metric", "unit", "value"]
    studied(workspace, "strain", "drift", pd.DataFrame(rows, columns=header))
    states = pd.DataFrame(rng.uniform(-1, 1, (40, 3)), columns=["h0", "h1", "h2"])
    states.assign(t_s=np.arange(40.0)).to_csv(shards.study_file(workspace, "strain", "latents", 0), index=False)
    return pa.table(columns), part, truth, lambda protocol: {protocol: ["error", "r2"]}


def glove(workspace, settings: dict, experiment: str = "glove") -> tuple:
    """Write frames, counts and studies; return the dataset of SESSIONS of every object, its parts, truth, metrics."""
    rng = np.random.default_rng(0)
    label = np.repeat(np.arange(len(OBJECTS)), SESSIONS * PICTURES)
    session = np.tile(np.repeat(np.arange(SESSIONS), PICTURES), len(OBJECTS))
    columns = {
        "condition": pa.array([OBJECTS[k] for k in label]).dictionary_encode(),
        "recording": pa.array([f"session{k:02d}" for k in session]).dictionary_encode(),
        "label": pa.array(label.astype(np.int16)),
    }
    shape = len(label), images.SIDE, images.SIDE
    pictures = {dataset: rng.integers(0, 256, shape).astype(np.uint8) for dataset in images.MODALITIES}
    part = np.where(session < 2, "train", np.where(session < 3, "validation", "test"))
    made = images.with_pictures(pa.table(columns), pictures), part, np.eye(len(OBJECTS))[label]
    metrics = lambda protocol: {images.modality(protocol): ["macro_precision", "accuracy"]}  # noqa: E731
    workspace.experiment_folder(experiment).mkdir(parents=True, exist_ok=True)
    if experiment == "glove_recorded":
        rows = [
            (name, split, s, "accuracy", "1", v + 0.01 * s, 9)
            for name, v in (("all", 0.9), ("still", 0.8))
            for split in ("grasp", "block")
            for s in (0, 1)
        ]
        header = ["input", "split", "seed", "metric", "unit", "value", "n"]
        path = shards.study_file(workspace, "glove_recorded", "joint_angles", 0)
        path.parent.mkdir(parents=True, exist_ok=True)
        pd.DataFrame(rows, columns=header).to_csv(path, index=False)
        return *made, metrics
    n = len(OBJECTS) * 4
    frames = pa.table(
        {
            "condition": pa.array(np.repeat(OBJECTS, 4).tolist()).dictionary_encode(),
            "recording": pa.array(["session00", "session01"] * (n // 2)).dictionary_encode(),
            "pressure": schemas.lists(rng.integers(0, 500, (n, 270)), pa.int16()),
            "strain": schemas.lists(rng.integers(1, 500, (n, 135)), pa.int16()),
        }
    )
    schemas.write(workspace.frames("glove"), frames.schema, [frames])
    all_ = by_frames({"sp_resnet": [0.7, 0.8], "resnet3x3": [0.6, 0.75]})
    one = by_frames({"sp_resnet": [0.65, 0.68, 0.72], "resnet3x3": [0.5, 0.6, 0.65]}, 1, "mean")
    together = pd.concat(
        [all_.assign(condition="combined"), *(one.assign(condition=d) for d in ("combined", "pressure"))]
    )
    studied(workspace, "glove", "input_frames", together)
    workspace.reports.mkdir(exist_ok=True)
    rows = [
        ("resnet18", "3x224x224", 1000, 1824033792, 11689512, 1824000000, 11690000, "reproduced", np.nan),
        ("sp_resnet", "1x32x32", 1000, 77, 88, 16332000, 326000, "contradicted", "reduction 16, as trained"),
        ("sp_resnet", "1x32x32", 1000, 78, 89, 16332000, 326000, "contradicted", "reduction 8"),
    ]
    costs = {"resnet18": 100, "mobilenet": 20, "resnet3x3": 200, "sp_resnet_nogcam": 10, "sp_resnet": 30}
    rows += [(model, "1x32x32", 16, cost, 10 * cost, np.nan, np.nan, np.nan, np.nan) for model, cost in costs.items()]
    header = "model input_shape classes macs params published_macs published_params verdict note".split()
    pd.DataFrame(rows, columns=header).assign(experiment="glove").to_csv(workspace.reports / "counts.csv", index=False)
    return *made, metrics


def augmented() -> pd.DataFrame:
    """Return what the evidence has of SP-ResNet without augmentation and with each method alone, as claim inputs."""
    rows = [
        ("glove", f"session_{dataset}", dataset, "sp_resnet", f"augmentation_{method}", metric, seed, "1",
         0.5 + 0.1 * place + 0.01 * seed * (place + 1))
        for place, method in enumerate(("none", "A", "B", "C"))
        for dataset in images.MODALITIES
        for seed in SEEDS
        for metric in ("macro_precision", "accuracy")
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=[*claim_inputs.KEY, "seed", "unit", "value"]).assign(budget="", n=36)


def studied(workspace, experiment: str, table: str, rows: pd.DataFrame) -> None:
    """Write a table of a study as the evidence has it, a file a seed."""
    for seed, own in rows.groupby("seed"):
        target = shards.study_file(workspace, experiment, table, seed)
        target.parent.mkdir(parents=True, exist_ok=True)
        own.to_csv(target, index=False)


def varied(workspace, experiment: str, rows: list[tuple]) -> None:
    """Keep the runs of variants as the evidence has them, a shard a seed, beside the sets of the miniature.

    rows: protocol, condition, model, variant, metric, seed, unit, value.
    """
    columns = ["protocol", "condition", "model", "variant", "metric", "seed", "unit", "value"]
    table = pd.DataFrame(rows, columns=columns).assign(experiment=experiment, budget="", n=12)
    for seed, own in table.groupby("seed"):
        name = f"variants_{experiment}-{seed}-full"
        write_table(shards.result_file(workspace, name), own[claim_inputs.COLUMNS])
        indexed(workspace, name, experiment, seed, shards.result_file(workspace, name))
    small_variants(workspace.root)


def by_frames(levels: dict, first: int = 2, form: str = "trained") -> pd.DataFrame:
    """Return rows of input_frames.csv; levels: model -> precision at `first` frames and on, a point more each seed."""
    rows = [
        (form, model, seed, frames, metric, "1", level + 0.01 * seed, 9)
        for model, values in levels.items()
        for frames, level in enumerate(values, first)
        for seed in SEEDS
        for metric in ("macro_precision", "accuracy")
    ]
    return pd.DataFrame(rows, columns=["form", "model", "seed", "frames", "metric", "unit", "value", "n"])


DATA = {
    "touch": touch,
    "velostat_recorded": velostat_recorded,
    "array_recorded": array_recorded,
    "strain": strain,
    "strain_recorded": lambda workspace, settings: strain(workspace, settings, "strain_recorded"),
    "glove": glove,
    "glove_recorded": lambda workspace, settings: glove(workspace, settings, "glove_recorded"),
}


def unplot(patch) -> None:
    """Have files of figures made, and no figures."""
    for module in (common, glove_figures, speed, strain_figures, touch_figures):
        for name, function in list(vars(module).items()):
            own = getattr(function, "__module__", "") == module.__name__
            if own and "path" in getattr(function, "__annotations__", {}):
                patch.setattr(module, name, lambda path, *_, **__: path.touch())


def rendered(workspace, experiment: str, settings: dict, monkeypatch, *look: str):
    """Return the folder that `python -m pipeline.stages.render <experiment> [look]` writes."""
    monkeypatch.setattr(render.params, "load", lambda _: {"experiments": [experiment], experiment: settings})
    monkeypatch.setattr(sys, "argv", ["render", experiment, *look])
    render.main(workspace)
    return (workspace.look if look else workspace.reports) / experiment
