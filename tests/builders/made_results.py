"""Write the results of touch that the stages before `track` leave behind, with made-up numbers."""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from tactile import models
from tactile.datasets import schemas
from tactile.experiments.touch import frames_schema
from tactile.tasks import windows

EPOCHS = 5
SCORES = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]


def write_results(root: Path, params: dict, condition: str = "single") -> None:
    """Write the files of every run of `params["touch"]`; the model's settings and the window change model and score."""
    settings, touch = params["touch"], root / "data" / "touch"
    runs = [(protocol, seed) for protocol, block in settings["protocols"].items() for seed in block["seeds"]]
    for name in ("latency", "speed"):
        (touch / name).mkdir(parents=True, exist_ok=True)
    scores = []
    for model, block in settings["models"].items():
        made_from = json.dumps([block, settings.get("window")])
        for protocol, seed in runs:
            folder = touch / "models" / model / f"{protocol}-{seed}"
            folder.mkdir(parents=True, exist_ok=True)
            epochs = range(1, EPOCHS + 1 if "training" in block else 2)
            history = {
                "epoch": epochs,
                "train_loss": [9.0 / epoch for epoch in epochs],
                "validation_loss": [10.0 / epoch for epoch in epochs],
                "learning_rate": 1.0e-3,
            }
            pd.DataFrame(history).to_csv(folder / "history.csv", index=False)
            fit = {"stop_reason": "closed_form", "best_epoch": len(epochs), "epochs": len(epochs), "parameters": 17}
            (folder / "fit.json").write_text(json.dumps(fit | {"macs": None, "precision": None, "settings": block}))
            (folder / "estimator.skops").write_bytes(f"{model} {protocol} {seed} {made_from}".encode())
            value = 8.5 + seed + block.get("min_samples_leaf", 0) / 100
            scores.append(("touch", protocol, condition, model, seed, "rmse", "kPa", value, 40))
        times = pd.DataFrame([(*run, 2.0) for run in runs], columns=["protocol", "seed", "train_s"])
        times.to_csv(touch / "latency" / f"{model}.train.csv", index=False)
    pd.DataFrame(scores, columns=SCORES).to_csv(touch / "scores.csv", index=False)
    pd.DataFrame(
        [
            ("touch", model, batch, 1, 0.5, 0.4, 0.6, 0.7, 17, 17, 2.0, 999)
            for model in settings["models"]
            for batch in (1, 256)
        ],
        columns=[
            *"experiment model batch threads p50_ms p50_low_ms p50_high_ms p95_ms".split(),
            *"params macs train_s size_bytes".split(),
        ],
    ).to_csv(touch / "speed" / "latency.csv", index=False)
    (touch / "ingest.json").write_text('{"run": true}')
    n, elements = 40, settings["sensor"]["rows"] * settings["sensor"]["cols"]
    nowhere = np.full((n, 1), np.nan)
    frames = schemas.frame_rows(
        frames_schema(settings),
        condition,
        "run000",
        segment=np.zeros(n, np.int16),
        t_s=0.02 * np.arange(n),
        v=np.arange(n * elements).reshape(n, elements) % 1024,
        force_n=nowhere,
        x_mm=nowhere,
        y_mm=nowhere,
    )
    schemas.write(touch / "frames.parquet", frames.schema, [frames])


def fit_linear(touch: dict, seed: int, folder: Path):
    """Fit a linear model to windows and maps of a seed of its own, save it into `folder` and return it."""
    spec, rng = windows.spec(touch), np.random.default_rng(seed)
    model = models.build("linear", spec, {}, "touch.models.linear")
    x, y = rng.normal(size=(90, spec.frames, spec.elements)), rng.normal(size=(90, spec.outputs))
    part = x.astype(np.float32), y.astype(np.float32)
    model.fit(part, part, seed=seed)
    model.save(folder)
    return model
