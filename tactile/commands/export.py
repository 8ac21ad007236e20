"""Make a folder of a trained model that needs nothing else of this checkout; as ONNX, it does not need torch either.

MODEL is EXPERIMENT/MODEL such as touch/lomp_stream (the model that this checkout trained, else the pretrained one),
EXPERIMENT/MODEL/PROTOCOL/SEED, or a folder that this command made. FOLDER, which must not exist, gets the weights and
card.json: what readings the model takes, what it predicts and how far off that may be, its settings and its test
scores. The card names every file by its digest, so that a damaged or exchanged one is refused. A model of series that
was fitted to its validation part is fitted again without it, to calibrate its intervals; that takes as long as its
training, once. With --onnx FOLDER also gets model.onnx, which is compared with torch.

Examples:

    tactile export touch/lomp_stream exported/lomp --onnx
"""

import argparse
import shutil
import tempfile
from pathlib import Path

from tactile.base import files, params, processes
from tactile.base.errors import InputError
from tactile.base.paths import Workspace


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the model, the new folder and what is written beside the weights to the parser of this command."""
    parser.add_argument("model", metavar="MODEL")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a new folder")
    parser.add_argument("--onnx", action="store_true", help="write model.onnx, too")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Export the model named on the command line."""
    from tactile.inference import card as cards
    from tactile.inference import consistent, packages

    if given.folder.exists():
        raise InputError(f"{given.folder}: exists already and is never overwritten; give another name")
    values = params.load(workspace.params)
    with tempfile.TemporaryDirectory() as draft:
        source, comes_from = packages.locate(workspace, given.model, values, Path(draft, "located"), refit=True)
        card, package = consistent.read(source), Path(draft, "package")
        package.mkdir()
        shutil.copy(cards.weights_file(source), package)
        cards.write(package, card)
        print(f"{card.experiment}/{card.model}: {comes_from}")
        if given.onnx:
            _write_onnx(package)
        with files.replacing_folder(given.folder) as target:
            shutil.copytree(package, target, dirs_exist_ok=True)
    print(f"written to {given.folder}")


def _write_onnx(package: Path) -> None:
    """Write the network of a package as ONNX into it, and say how large the file is and how well it agrees."""
    from tactile.inference import onnx_export, onnx_network, predictor

    processes.torch_on_one_thread()
    difference = onnx_export.export(predictor.load(package), package)
    size = f"{onnx_network.NAME}: {(package / onnx_network.NAME).stat().st_size / 1e6:.2f} MB"
    print(f"{size}, differs from the model by up to {difference:.1g} of full scale")
