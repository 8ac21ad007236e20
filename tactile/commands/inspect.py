"""Say what a package holds before anything of it is loaded, and whether its files are those that its card names.

FOLDER is what `tactile export` made, or the model of a target of one's own, build/own/NAME/trained/target. Its card is
read; of the estimator its list of types, of a network the names and shapes of its weights, of ONNX its inputs and
outputs, which nothing runs. A folder that is damaged, or was changed, is told as far as it can be read, with what is
wrong, and with exit status 1.

Examples:

    tactile inspect pretrained/touch/lomp_stream
"""

import argparse
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tactile.base import arguments, cards, foreign
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

AGAIN = "copy it again"
LARGEST_HEADER = 100_000_000  # bytes, as of safetensors
MOST = 12  # tensors or types that are printed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the folder to the parser of this command."""
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    arguments.add_output(parser)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Print what the folder named on the command line holds; InputError where something is wrong with it."""
    found = inspected(given.folder)
    print(*lines(found), sep="\n")
    arguments.answer(given, found)
    if found["wrong"]:
        count = len(found["wrong"])
        raise InputError(f"{given.folder}: {count} thing{'s' * (count > 1)} wrong, the first: {found['wrong'][0]}")


def inspected(folder: Path) -> dict[str, Any]:
    """Return what a package holds: `files` (size, digest, whether it is the one named), `card`, `holds`, `wrong`.

    Raises InputError where the folder has no card.
    """
    from tactile.inference import card as of_export
    from tactile.inference import consistent
    from tactile.targets import kept

    kinds = {
        kept.CARD: (kept.Card, (kept.WEIGHTS,), kept.AGAIN, kept.check),
        of_export.NAME: (
            of_export.Card,
            (*of_export.WEIGHTS, of_export.ONNX),
            of_export.AGAIN,
            lambda card, path: consistent.check(card, path, of_export.AGAIN),
        ),
    }
    name = next((name for name in kinds if (folder / name).is_file()), of_export.NAME)
    kind, package, again, check = kinds[name]
    path, card, wrong, faults, named = folder / name, None, [], {}, {}
    if not any((folder / each).is_file() for each in (name, *package)):
        raise InputError(f"{folder}: no {' or '.join(kinds)} in it, so it is no package")
    try:
        card, text = cards.parsed(path, kind, again)
        faults, named = cards.faults(path, card, text, package), card.files
        wrong += [f"{sentence}; {again}" for sentence in faults.values()]
        check(card, path)
    except InputError as error:
        wrong.append(str(error))
    files = {}
    for file in sorted({*(each for each in package if (folder / each).exists()), *named, name}):
        if file in (*package, name):
            files[file] = _file(folder / file) | {
                "named": None if card is None else file in named and file not in faults
            }
    holds = {}
    for file in files:
        if file in HOLDS and (folder / file).is_file():
            try:
                holds[file] = HOLDS[file](folder / file)
            except InputError as error:
                wrong.append(str(error))
    others = sorted(each.name for each in folder.iterdir() if each.name not in files)
    said = {} if card is None else _said(card)
    return {
        "folder": str(folder),
        "files": files,
        "read_by_nothing": others,
        "card": said,
        "holds": holds,
        "wrong": wrong,
    }


def _file(path: Path) -> dict[str, Any]:
    """Return size and digest of a file, without them where it is not there."""
    return {"bytes": path.stat().st_size, "sha256": cards.digest(path)} if path.is_file() else {}


def _said(card: Any) -> dict[str, Any]:
    """Return what a card says in few words, of either kind."""
    known = card.model_dump(mode="json")
    keys = ("experiment", "kind", "model", "protocol", "seed", "commit", "version", "source", "sensor", "target")
    keys += ("classes", "window_s", "elements", "inputs", "outputs", "shapes")
    said = {key: known[key] for key in keys if key in known}
    if "target" in known:
        said["interval"] = known["bound"] is not None
    else:
        said["interval"] = known["calibration"] is not None
    said["trained_on"] = [
        {key: each[key] for key in ("name", "first")}
        | {"columns": len(each["columns"]), "least": min(each["low"]), "most": max(each["high"])}
        for each in known["trained_on"] or []
    ]
    return said | {"logs": None if known["logs"] is None else len(known["logs"])}


def _made_by(card: dict[str, Any]) -> str:
    """Return the commit that a model was made at, and the version of the project there."""
    return f"commit {card['commit']}" + (f", version {card['version']}" if card["version"] else "")


def _of_estimator(path: Path) -> dict[str, int]:
    """Return how many objects of each type an estimator's file asks for; none is made."""
    from tactile.learning import structure

    with foreign.reading(path, "an estimator's file", AGAIN):
        return structure.types(path)


def _of_network(path: Path) -> dict[str, str]:
    """Return type and shape of each tensor of a file of weights, from its header alone."""
    with foreign.reading(path, "a file of weights", AGAIN), open(path, "rb") as file:
        size = int.from_bytes(file.read(8), "little")
        if size > min(LARGEST_HEADER, path.stat().st_size):
            raise ValueError(f"its header has {size} bytes")
        header = json.loads(file.read(size))
        header.pop("__metadata__", None)
        return {
            _plain(name): _plain(f"{each['dtype']} {' x '.join(map(str, each['shape'])) or '1'}")
            for name, each in header.items()
        }


def _of_onnx(path: Path) -> dict[str, Any]:
    """Return how often a file of ONNX has each operator, and whether it has its weights in other files."""
    import onnx

    with foreign.reading(path, "a file of ONNX", AGAIN):
        model = onnx.load_model(path, load_external_data=False)
        counts: dict[str, int] = {}
        graphs, outside = [model.graph, *model.functions], 0
        while graphs:
            graph = graphs.pop()
            for node in graph.node:
                name = _plain(f"{node.domain}.{node.op_type}".removeprefix("."))
                counts[name] = counts.get(name, 0) + 1
                graphs += [each.g for each in node.attribute if each.HasField("g")]
            outside += sum(
                each.data_location == onnx.TensorProto.EXTERNAL for each in getattr(graph, "initializer", ())
            )
        return {"operators": dict(sorted(counts.items())), "weights_elsewhere": outside}


HOLDS: Mapping[str, Callable[[Path], dict]] = {
    "estimator.skops": _of_estimator,
    "network.safetensors": _of_network,
    "model.onnx": _of_onnx,
}


def _plain(text: str) -> str:
    """Return text of a file in printable characters, cut."""
    return foreign.reason(ValueError(text))


def lines(found: Mapping) -> Iterator[str]:
    """Yield what `inspected` found, for people."""
    card = found["card"]
    for name, each in found["files"].items():
        right = {True: "as the card names it", False: "NOT as the card names it", None: "the card cannot be read"}
        size = f"{each['bytes']} bytes, SHA-256 {each['sha256'][:16]}" if "bytes" in each else "not there"
        yield f"{name}: {size}, {right[each['named']]}"
    if found["read_by_nothing"]:
        yield f"read by nothing: {', '.join(map(_plain, found['read_by_nothing']))}"
    if card:
        what = card["target"]["name"] if "target" in card else f"{card['protocol']}, seed {card['seed']}"
        yield f"model: {card['experiment']}/{card['model']}, {what}, of {_made_by(card)}"
        yield from _taken_and_given(card)
        for each in card["trained_on"]:
            span = f"{each['least']:.4g} to {each['most']:.4g}"
            yield f"trained on: {span} in {each['columns']} columns {each['name']}, from column {each['first']} on"
        known, told = "not said" if card["logs"] is None else card["logs"], "yes" if card["interval"] else "none"
        yield f"logs that it says it was trained or tested on: {known}; intervals: {told}"
    for name, held in found["holds"].items():
        if "operators" in held:
            what = [f"{count} {each}" for each, count in held["operators"].items()]
        else:
            what = [f"{count} {each}" if isinstance(count, int) else f"{each} {count}" for each, count in held.items()]
        more = f" and {len(what) - MOST} more" if len(what) > MOST else ""
        yield f"{name} holds: {', '.join(what[:MOST])}{more}"
    yield from (f"wrong: {sentence}" for sentence in found["wrong"])


def _taken_and_given(card: Mapping) -> Iterator[str]:
    if "target" in card:
        what = ", ".join(card["classes"]) or f"a number in {card['target']['unit']}"
        yield f"takes: windows of {card['window_s']:g} s of {card['elements']} elements of {card['sensor']}"
        yield f"gives: {what}"
        return
    inputs, outputs, shapes = card["inputs"], card["outputs"], card["shapes"]
    reading_ = f"{inputs['columns']} {inputs['unit']} a reading, one every {inputs['interval_s']:g} s"
    yield f"takes: {reading_}, {inputs['order']}"
    what = ", ".join(outputs["names"] or []) or f"maps of {shapes['map_rows']} x {shapes['map_cols']}"
    yield f"gives: {what}, in {outputs['unit']}"
