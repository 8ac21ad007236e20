"""Time and memory of one task in a process of its own.

Usage: python -m benchmarks.measure TASK FOLDER SIZE   (prints a JSON object; `measured` runs it)
"""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from benchmarks.made import ROOT
from tactile import models
from tactile.base import processes
from tactile.base.paths import Workspace

HERE = Path(__file__).resolve().parent
UPDATES, EPOCHS = 5, 3  # of a network, timed together


def measured(task: str, folder: Path, size: float = 0, worker: bool = False) -> dict:
    """{'seconds', 'mb', 'imports_mb'} of a task: its time, its largest memory and its children's less that of the
    imports, and the memory of the imports.

    worker: the process keeps its memory, as those do that the pipeline trains in.
    """
    path = os.pathsep.join([str(HERE.parent), str(HERE.parent / "tests")])
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.measure", task, str(folder), str(size)],
        env=os.environ | {"PYTHONPATH": path} | ({"GLIBC_TUNABLES": processes.KEEP_MEMORY} if worker else {}),
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"{task}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def read_log(folder: Path, _):
    """The array's log, all lines checked."""
    from benchmarks.made import touch_settings
    from tactile.experiments import touch
    from tactile.logs import parse

    fmt = touch.array_format(touch_settings())
    return lambda: parse.read_log(folder / "array.log", fmt)


def read_log_pandas(folder: Path, _):
    """The same with pandas, unchecked."""
    from benchmarks import peers

    return lambda: peers.read_log(folder / "array.log", ["t_us", *(f"v{k}" for k in range(25))])


def ingest(folder: Path, _):
    """All logs in `folder`/data/own/logs to frames: the stage."""
    from benchmarks.made import touch_settings
    from tactile.stages import ingest

    workspace, settings = Workspace(folder), touch_settings() | {"source": "data/own/logs"}
    return lambda: ingest.ingest(workspace, "touch", settings)


def predict(folder: Path, _):
    """The array's log in `folder`/data/own/logs to predictions of the pretrained streaming LoMP: the command."""
    import argparse

    from tactile.commands import predict as command

    given = argparse.Namespace(
        model="touch/lomp_stream", logs=folder / "data/own/logs", out=folder / "out", no_pictures=True, json=False
    )
    return lambda: command.main(Workspace(folder), given)


def dataset(folder: Path, _):
    """Frames to windows to a dataset: both stages, with the papers' amounts of windows and splits."""
    from benchmarks.made import at_papers_amount
    from tactile.base import params
    from tactile.stages import dataset, window

    values = at_papers_amount(folder)
    params.load = lambda *_: values  # in this process, which ends with the task
    workspace = Workspace(folder)

    def run():
        sys.argv = ["window", "touch"]
        window.main(workspace)
        sys.argv = ["dataset", "touch"]
        dataset.main(workspace)

    return run


def lomp_epoch(_, windows: float, side: int = 5):
    """An epoch of LoMP's training in batches as in params.yaml."""
    return _epoch(lomp(side, epochs=1), windows, side)


def cnn_epoch(_, windows: float):
    """An epoch of the CNN's training in batches as in params.yaml."""
    return _epoch(touch_network("cnn", 5, epochs=1), windows, 5)


def _epoch(model, windows: float, side: int):
    import numpy as np

    n, rng = int(windows), np.random.default_rng(0)
    x = rng.uniform(0, 500, (n, 8, side * side)).astype(np.float32)
    y = rng.uniform(0, 100, (n, 16 * side * side)).astype(np.float32)
    warm_up()
    return lambda: model.fit((x, y), (x[:1], y[:1]), seed=0, device="cpu")


def warm_up() -> None:
    """Make a process's first step of an optimiser, for which torch loads 2 s of its own code."""
    import torch

    layer = torch.nn.Linear(1, 1)
    layer(torch.ones(1, 1)).sum().backward()
    torch.optim.Adam(layer.parameters(), fused=True).step()


def lomp_epoch_elements(_, side: float):
    """An epoch of 512 windows of an array of side x side elements."""
    return lomp_epoch(_, 512, int(side))


def lomp_latency(_, side: float):
    """100 predictions, one window each."""
    import numpy as np

    model = lomp(int(side), epochs=1)
    x = np.random.default_rng(0).uniform(0, 500, (1, 8, int(side) ** 2)).astype(np.float32)
    for _ in range(5):
        model.predict(x)
    return lambda: [model.predict(x) for _ in range(100)]


def lomp_predictions(_, windows: float):
    """LoMP's maps of many windows, in one call."""
    import numpy as np

    model = lomp(5, epochs=1)
    x = np.random.default_rng(0).uniform(0, 500, (int(windows), 8, 25)).astype(np.float32)
    return lambda: model.predict(x)


def lstm_epochs(_, samples: float):
    """EPOCHS exact epochs of the strain LSTM."""
    from benchmarks.made import series

    record, model = series(int(samples)), lstm(epochs=EPOCHS)
    return _twice(lambda: model.fit([record], seed=0, device="cpu", base=None))


def lstm_epochs_plain(_, samples: float):
    """The same with nn.LSTM in float32, one update an epoch."""
    import torch

    from benchmarks import peers
    from benchmarks.made import series

    record, training = series(int(samples)), lstm(epochs=EPOCHS).training
    torch.manual_seed(0)
    network = peers.PlainLstm(6, 50, 2)
    x, y = torch.from_numpy(record.x)[None], torch.from_numpy(record.y)[None]
    return _twice(lambda: peers.lstm_epochs(network, x, y, EPOCHS, training.learning_rate, training.clip))


def _twice(run: Callable) -> Callable:
    """What is timed, after a first time."""
    run()
    return run


def lomp_updates(_, windows: float):
    """UPDATES updates of LoMP, a batch of `windows` each."""
    import torch

    from tactile.learning.training import precision_on

    model = lomp(5, epochs=UPDATES)
    model.training = model.training.model_copy(update={"batch_size": int(windows)})
    model.precision = precision_on(torch.device("cpu"), model.training.precision)
    optimiser = torch.optim.Adam(model.network.parameters(), fused=True)  # as tactile/learning/regressors.py
    x, y = _batch(windows)

    def descend(losses) -> torch.Tensor:
        optimiser.zero_grad()
        for loss in losses:
            loss.backward()
        optimiser.step()
        return torch.zeros(())

    def run() -> None:
        for _ in range(UPDATES):
            model.train_epoch((x, y), torch.Generator(), lambda _, batch: model.update((x, y), descend, batch))

    return _twice(run)


def lomp_updates_looped(_, windows: float):
    """The same with a loop over the elements."""
    from benchmarks import peers

    return _plain_updates(peers.LoopedLomp, windows)


def lomp_updates_stacked(_, windows: float):
    """The same with stacked weights under autograd."""
    from benchmarks import peers

    return _plain_updates(peers.StackedLomp, windows)


def _plain_updates(network, windows: float):
    import torch

    from benchmarks import peers
    from tactile.learning.training import precision_on

    model = lomp(5, epochs=1)
    precision = precision_on(torch.device("cpu"), model.training.precision)
    step = peers.train_step(network(model.network), *_batch(windows), precision)

    def run() -> None:
        for _ in range(UPDATES):
            step()

    return _twice(run)


def _batch(windows: float):
    import torch

    torch.manual_seed(0)
    return torch.randn(int(windows), 8, 25), torch.randn(int(windows), 400)


def sp_resnet_epoch(_, images: float):
    """An epoch of SP-ResNet on images of noise, of which the time does not depend."""

    block, x, y, spec = _images(images)
    model = models.build("sp_resnet", spec, block, "benchmark")
    return _twice(lambda: model.fit((x, y), (x[:1], y[:1]), seed=0, device="cpu"))


def sp_resnet_epoch_plain(_, images: float):
    """The same in a plain loop, default memory layout, the same augmentation."""
    import torch

    from benchmarks import peers
    from tactile.learning.image_classifier import augmented, draw_alterations
    from tactile.models import sp_resnet
    from tactile.settings.training import AugmentedTraining

    block, x, y, _ = _images(images)
    network, order = sp_resnet.network(1, 16, block["reduction"]), torch.Generator().manual_seed(0)
    shaped, labels = torch.from_numpy(x / 255).view(-1, 1, 32, 32), torch.from_numpy(y)
    training = AugmentedTraining(**block["training"])

    def altered(batch: torch.Tensor) -> torch.Tensor:
        return augmented(batch, training, draw_alterations(len(batch), batch.shape[1:], training, order))

    return _twice(lambda: peers.image_epoch(network, shaped, labels, training.batch_size, altered))


def _images(count: float):
    import numpy as np

    from tactile.base import params
    from tactile.learning.spec import of_images

    block = shortened(params.load(ROOT / "params.yaml")["glove"]["models"]["sp_resnet"], 1)
    rng = np.random.default_rng(0)
    x = rng.uniform(0, 255, (int(count), 1, 32 * 32)).astype(np.float32)
    return block, x, np.eye(16, dtype=np.float32)[rng.integers(0, 16, int(count))], of_images(16)


def lomp(side: int, epochs: int):
    """The touch experiment's LoMP on an array of side x side elements."""
    return touch_network("lomp", side, epochs)


def touch_network(model: str, side: int, epochs: int):
    """A network of the touch experiment on an array of side x side elements."""
    from benchmarks.made import touch_settings
    from tactile.learning.spec import Spec

    block = shortened(touch_settings()["models"][model], epochs)
    return models.build(model, Spec(8, side, side, 4 * side, 4 * side), block, "benchmark")


def lstm(epochs: int):
    """The strain experiment's LSTM, directly trained."""
    from tactile.base import params
    from tactile.learning.spec import Spec

    block = shortened(params.load(ROOT / "params.yaml")["strain"]["models"]["lstm_direct"], epochs)
    return models.build("lstm_direct", Spec(10, 1, 6, 1, 2), block, "benchmark")


def shortened(block: Mapping, epochs: int) -> dict:
    """A network's block of settings with another number of epochs."""
    training = block["training"]
    key = "epochs" if "epochs" in training else "max_epochs"
    return {**block, "training": {**training, key: epochs}}


TASKS = {
    function.__name__: function
    for function in (
        *(read_log, read_log_pandas, ingest, predict, dataset),
        *(lomp_epoch, lomp_epoch_elements, lomp_latency, lomp_updates, lomp_updates_looped, lomp_updates_stacked),
        *(cnn_epoch, lomp_predictions),
        *(lstm_epochs, lstm_epochs_plain, sp_resnet_epoch, sp_resnet_epoch_plain),
    )
}


def _memory_mb(key: str) -> float:
    """VmRSS or VmHWM (the largest VmRSS so far) of this process. Not `getrusage`: its peak includes the parent's."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(key))
    return int(line.split()[1]) * 1024 / 1e6


@contextmanager
def _children_mb() -> Iterator[list[float]]:
    """Give the block a list of one number: the most that all children held at once (Pss), seen every 50 ms."""
    most, ended, own = [0.0], threading.Event(), psutil.Process()

    def watch() -> None:
        while not ended.wait(0.05):
            held = 0
            for child in own.children(recursive=True):
                with suppress(psutil.Error):  # it has just ended
                    held += child.memory_full_info().pss
            most[0] = max(most[0], held / 1e6)

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    yield most
    ended.set()
    thread.join()


def main() -> None:
    """Run one task."""
    task, folder, size = sys.argv[1:]
    import numpy  # noqa: F401
    import pandas  # noqa: F401
    import pyarrow.parquet  # noqa: F401

    if task.startswith(("cnn", "lomp", "lstm", "sp_resnet")):
        import torch

        torch.set_num_threads(1)
    if task == "predict":
        from tactile.inference import predictions, recordings  # noqa: F401
    before = _memory_mb("VmRSS")
    prepared = TASKS[task](Path(folder), float(size))
    with _children_mb() as children_mb:
        began = time.perf_counter()
        prepared()
        seconds = time.perf_counter() - began
    most = _memory_mb("VmHWM") + children_mb[0]
    print(json.dumps({"seconds": seconds, "mb": most - before, "imports_mb": before}))


if __name__ == "__main__":
    main()
