"""Check that the parts of a card fit one another, and its settings their classes, before a model is built from them.

What a card says becomes shapes of arrays, limits of loops and columns of logs. A card that was made by hand, or by
another version, is so refused in a sentence that names the key.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tactile import experiments, tasks
from tactile.base import cards, foreign, params, ranges
from tactile.base.errors import InputError
from tactile.datasets import images
from tactile.inference.card import AGAIN, NAME, ONNX, WEIGHTS, Card, weights_file
from tactile.learning.spec import of_images
from tactile.settings.models import Models

READING = ("sensor", "ingest", "window", "label")  # blocks of an experiment that say how logs become inputs
LARGEST_INPUT = 1 << 24  # numbers of a window, 64 MB; the largest here has 12,500
LONGEST_S = 3600.0  # of a window; the longest here lasts 2
APART_S = 60.0  # from one frame of a window to the next; 0.2 here
Fact = tuple[str, bool, str]  # key of the card, whether it is as it should be, what it should be


def read(folder: Path) -> Card:
    """Return the card of a saved model.

    Raises InputError where it is absent, broken, or does not fit itself, and where the files are not its.
    """
    path = folder / NAME
    if not path.is_file():
        raise InputError(f"{path}: not found; make the folder with `tactile export MODEL FOLDER`")
    weights = weights_file(folder)
    card = cards.read(path, Card, (*WEIGHTS, ONNX), AGAIN)
    if [name for name in WEIGHTS if name in card.files] != [weights.name]:
        raise InputError(f"{path}, files: names {' and '.join(WEIGHTS)}, of which a model has one; {AGAIN}")
    check(card, path, AGAIN)
    return card


def check(card: Card, path: Path, again: str) -> None:
    """Raise InputError, which names `path`, ends in `again`, and says which key of a card does not fit the others."""
    cards.check_blocks(path, "reading", card.experiment, card.reading, READING, again)
    if card.model not in Models.model_fields:
        raise InputError(
            f"{path}, model: there is no model '{card.model}'; {params.hint(card.model, Models.model_fields)}; {again}"
        )
    cards.check_block(path, "settings", card.settings, Models.model_fields[card.model].annotation, again)
    try:
        for key, holds, words in _facts(card):
            if not holds:
                raise InputError(f"{key}: {words}")
    except InputError as error:
        raise InputError(f"{path}, {error}; {again}") from error
    except Exception as error:  # what the code of an experiment makes of settings that no sensor has
        raise InputError(f"{path}: its parts do not fit one another ({foreign.reason(error)}); {again}") from error


def _facts(card: Card) -> Iterator[Fact]:
    """Yield what must hold of a card, each after what it builds on."""
    module, reading, inputs, outputs = experiments.module(card.experiment), card.reading, card.inputs, card.outputs
    yield "kind", card.kind == module.KIND, f"of {card.experiment} it is {module.KIND}"
    experiments.sensor_format(card.experiment, reading)  # which raises where no log could be read
    schema = module.frames_schema(reading)
    of = images.reading_columns(schema) if card.kind == "images" else ["v"]
    areas = {name: schema.field(name).type.list_size for name in of}
    columns = sum(areas.values())
    yield "inputs.columns", inputs.columns == columns, f"by reading.sensor it is {columns}"
    if "order" in reading.get("sensor", {}):
        module.in_order(np.zeros((0, columns)), reading)
    unit = reading.get("sensor", {}).get("unit", module.FACTS.unit)
    yield "inputs.unit", inputs.unit == unit, f"by reading.sensor it is {unit}"
    step = reading["window"].get("frame_step", 1)
    yield "inputs.frame_step", inputs.frame_step == step, f"by reading.window it is {step}"
    chosen = range(columns) if inputs.chosen is None else inputs.chosen
    right = len(set(chosen)) == len(chosen) > 0 and set(chosen) <= set(range(columns))
    yield "inputs.chosen", right, f"it has to name some of the columns 0 to {columns - 1}, each once"
    yield "inputs.chosen", card.kind == "series" or inputs.chosen is None, f"models of {card.kind} see all columns"
    yield from _shapes(card, module, len(chosen))
    apart = step * inputs.interval_s
    yield "inputs.interval_s", apart <= APART_S, f"frames would be {apart:.3g} s apart, more than {APART_S:g}"
    span = card.shapes.frames * step * inputs.interval_s
    yield "inputs.interval_s", span <= LONGEST_S, f"a window would last {span:.3g} s, more than {LONGEST_S:g}"
    unit = module.FACTS.output_unit
    yield "outputs.unit", outputs.unit == unit, f"of {card.experiment} it is {unit}"
    yield "outputs.touch_kpa", (outputs.touch_kpa is None) == (unit != "kPa"), "maps in kPa have one, others none"
    yield "outputs.force_gain", outputs.force_gain is None or unit == "kPa", "only maps in kPa have one"
    yield from _trained_on(card, areas, list(chosen))
    if card.correlation is not None:
        inside = set(card.correlation.columns) <= set(range(columns))
        yield "correlation.columns", inside, f"a reading has the columns 0 to {columns - 1}"
    known = {"windows": ["force_n", "peak_kpa"], "series": outputs.names, "images": ["object"]}[card.kind]
    bounds = card.calibration.bounds if card.calibration else []
    named = [(each.output, each.case) for each in bounds]
    right = {output for output, _ in named} <= set(known) and len(set(named)) == len(named)
    yield "calibration.bounds", right, f"the outputs are {', '.join(known)}, each once in a case"
    right = all(each.value is None or each.output != "object" or each.value <= 1 for each in bounds)
    yield "calibration.bounds", right, "a probability is 1 at most"


def _shapes(card: Card, module, columns: int) -> Iterator[Fact]:
    """Yield what must hold of shapes and names; columns: those that the model sees."""
    shapes, names, reading = card.shapes, card.outputs.names, card.reading
    task = tasks.of(card.experiment)
    if card.kind == "windows":
        yield "outputs.names", names is None, "a map has none"
        spec = task.spec(reading)
    elif card.kind == "series":
        axes = [f"{'xyz'[k]}_mm" for k in module.task(card.protocol, reading).outputs]
        yield "outputs.names", names == axes, f"by the protocol {card.protocol} they are {', '.join(axes)}"
        spec = task.spec(card.experiment, reading, card.protocol)._replace(cols=columns)
    else:
        known, images_ = images.modalities(reading), images.modality(card.protocol)
        yield "protocol", images_ in known, f"it has to end in one of {', '.join('_' + each for each in known)}"
        yield "outputs.names", bool(names) and len(set(names)) == len(names), "a model of images has some, each once"
        spec = of_images(len(names), images.shape(reading))
    for name, value in spec._asdict().items():
        yield f"shapes.{name}", getattr(shapes, name) == value, f"by reading and outputs it is {value}"
    size = shapes.frames * shapes.rows * shapes.cols
    yield "shapes", size <= LARGEST_INPUT, f"a window would have {size} numbers, more than {LARGEST_INPUT}"


def _trained_on(card: Card, areas: Mapping[str, int], chosen: list[int]) -> Iterator[Fact]:
    """Yield what must hold of the ranges of the training; areas: columns of each, chosen: those that the model sees."""
    if card.trained_on is None:
        return
    if card.kind == "images" and (seen := images.modality(card.protocol)) in areas:
        first = sum(areas[name] for name in list(areas)[: list(areas).index(seen)])
        chosen = list(range(first, first + areas[seen]))
    yield "trained_on", ranges.places(card.trained_on) == chosen, "it has a range for each column that the model sees"
