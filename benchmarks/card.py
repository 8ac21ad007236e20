"""Time the training of every network of windows and images on a card, beside one thread of its machine's CPU.

Usage: python -m benchmarks.card OUT.csv [MODEL ...]
Columns: seconds of an update on the CPU, on the card launched kernel by kernel, and on the card as a CUDA graph; the
kernels of an update; TFLOP/s of the graph (three times the multiply-accumulates of the forward pass, two operations
each) and its share of what a bfloat16 product of 8192 x 8192 matrices reaches; losses after EPOCHS epochs of noise,
which say whether all three train alike.
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np
import torch

from tactile import models
from tactile.base import params
from tactile.learning import updates
from tactile.learning.spec import Spec, of_images

EPOCHS = 3
UPDATES = 24  # of an epoch
CPU_UPDATES = 6
TOUCH = ("cnn", "vgg", "convlstm", "rnn", "lomp", "lomp_stream")
GLOVE = ("resnet18", "mobilenet", "resnet3x3", "sp_resnet_nogcam", "sp_resnet")
WINDOWS = 10  # of a press, for lomp_stream
COLUMNS = ("model", "batch", "cpu_s", "card_s", "graph_s", "kernels", "tflops", "share")
COLUMNS += ("cpu_loss", "card_loss", "graph_loss")


def model_and_data(name: str, count: int):
    """Return a model of `EPOCHS` epochs, a training part of `count` updates an epoch, and a validation part."""
    values = params.load(Path("params.yaml"))
    experiment = "touch" if name in TOUCH else "glove"
    block = dict(values[experiment]["models"][name])
    batch = block["training"]["batch_size"]
    block["training"] = {**block["training"], "epochs": EPOCHS, "rest_share": 1.0}
    rng, n = np.random.default_rng(0), batch * count
    if experiment == "glove":
        block["training"].pop("rest_share")
        x = rng.integers(0, 255, (n, 1, 1024)).astype(np.float32)
        y = np.eye(26, dtype=np.float32)[rng.integers(0, 26, n)]
        return models.build(name, of_images(26), block, name), (x, y), (x[:64], y[:64]), batch
    if name == "lomp_stream":
        block["training"].pop("rest_share")
    x = rng.uniform(0, 20, (n, 8, 25)).astype(np.float32)
    y = np.repeat(x[:, -1], 16, axis=1)
    data = (x, y)
    if name == "lomp_stream":
        previous = np.arange(n) - 1
        previous[::WINDOWS] = -1
        data = (x, y, previous)
    return models.build(name, Spec(8, 5, 5, 20, 20), block, name), data, tuple(one[:40] for one in data), batch


def timed(name: str, device: str, count: int) -> tuple[float, float]:
    """Return the seconds of an update, of the epochs after the first, and the last training loss."""
    model, train, validation, _ = model_and_data(name, count)
    times = []
    history = model.fit(train, validation, seed=0, device=device, progress=lambda *_: times.append(time.perf_counter()))
    return (times[-1] - times[0]) / (EPOCHS - 1) / count, history[-1]["train_loss"]


def kernels(name: str) -> float:
    """Return the kernels of an update, launched one by one."""
    from torch.profiler import ProfilerActivity, profile

    model, train, validation, _ = model_and_data(name, 4)
    with profile(activities=[ProfilerActivity.CUDA]) as noted:
        model.fit(train, validation, seed=0, device="cuda")
    return sum(event.count for event in noted.key_averages() if event.device_type.name == "CUDA") / 4 / EPOCHS


def peak() -> float:
    """Return the operations per second of a bfloat16 product of 8192 x 8192 matrices."""
    a = torch.randn(8192, 8192, device="cuda", dtype=torch.bfloat16)
    for _ in range(3):
        a @ a
    torch.cuda.synchronize()
    started = time.perf_counter()
    for _ in range(10):
        a @ a
    torch.cuda.synchronize()
    return 10 * 2 * 8192**3 / (time.perf_counter() - started)


def main() -> None:
    """Write a row for each model as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", type=Path)
    parser.add_argument("models", nargs="*", default=[*TOUCH, *GLOVE])
    given = parser.parse_args()
    torch.set_num_threads(1)
    best = peak()
    with open(given.target, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for name in given.models:
            graph_s, graph_loss = timed(name, "cuda", UPDATES)
            eager, updates.EAGER = updates.EAGER, 10**9
            card_s, card_loss = timed(name, "cuda", UPDATES)
            count = kernels(name)
            updates.EAGER = eager
            cpu_s, cpu_loss = timed(name, "cpu", CPU_UPDATES)
            model, _, _, batch = model_and_data(name, 1)
            rate = 6 * model.macs() * batch / graph_s * (8 if name == "lomp_stream" else 1)
            row = [name, batch, *(f"{s:.6f}" for s in (cpu_s, card_s, graph_s)), f"{count:.0f}", f"{rate / 1e12:.3f}"]
            row += [f"{rate / best:.4f}", *(f"{loss:.6g}" for loss in (cpu_loss, card_loss, graph_loss))]
            table.writerow(row)
            file.flush()
            print(*row, flush=True)


if __name__ == "__main__":
    main()
