"""Predict with a trained model: raw logs in, maps, positions or objects out. No ground truth is needed.

MODEL is a folder that `tactile export` made, EXPERIMENT/MODEL such as touch/lomp_stream (the model that this checkout
trained, else the pretrained one), EXPERIMENT/MODEL/PROTOCOL/SEED, the id of a run in MLflow, or the folder of a target
of one's own, build/own/NAME/trained/target, whose predictions are not drawn. LOGS is a log of the
sensor (array.log, daq.log, scanner.log), or a folder with such logs in it or below. Lines are read, cut into windows
and normalised as in training. OUT gets predictions.parquet (one row per reading), summary.json, of each recording a
picture, and of a touch sensor's an animation. Every prediction has its 90 % interval, or set of objects, beside it
where the model's card has a calibration and the reading lies within those of the training. Where the ground truth lies
beside a log, the model is scored against it, unless it was trained on this very log, whatever that is called now: then
the scores of its test are quoted. A log among several that cannot be read, or any whose ground truth cannot, is listed,
with exit status 1, and the others are predicted and scored. A recording is called by its path below LOGS. OUT is
predictions/NAME where --out does not say it, NAME that of the folder or log; there, predictions of another model or of
other logs are not replaced.

Examples:

    tactile predict touch/lomp_stream data/sample
    tactile predict build/own/finger/trained/target new_logs --out predictions/new
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

from tqdm import tqdm

from tactile.base import arguments, files, params, processes
from tactile.base import cards as base_cards
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.own.beside import Beside

T = TypeVar("T")
MOST_LINES = 10  # recordings that are printed
MOST_PICTURES = 20  # recordings that are drawn: each takes a second


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add model, logs and the place of the results to the parser of this command."""
    parser.add_argument("model", metavar="MODEL")
    parser.add_argument("logs", type=Path, metavar="LOGS")
    parser.add_argument("--out", type=Path, metavar="OUT", help="a folder; what it holds is replaced")
    parser.add_argument("--no-pictures", action="store_true", help="write the table and the summary only")
    arguments.add_output(parser)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Predict the logs named on the command line."""
    if not given.logs.exists():  # before the libraries are loaded, which takes seconds
        raise InputError(f"{given.logs.absolute()}: not found; name a log, or a folder with logs in it or below")
    if (Path(given.model) / base_cards.TARGET).is_file():
        return of_target(workspace, given)
    from tactile.inference import intervals, packages, predictions, predictor, recordings

    with tempfile.TemporaryDirectory() as draft:
        folder, comes_from = packages.locate(
            workspace, given.model, params.load(workspace.params), Path(draft, "package")
        )
        model = predictor.load(folder)
    processes.torch_on_one_thread()
    card = model.card
    print(f"{card.experiment}/{card.model}: {comes_from}")
    place, logs, target = _asked(given, card.experiment, predictions.model_of(card))
    names, summaries, notes, unread, unscored = [], [], [], [], []
    beside = Beside(workspace, card.experiment, f"{card.experiment}/{card.model}", card.reading)

    with files.replacing_folder(target) as draft:

        def opened(path: Path, name: str) -> tuple[recordings.Recording, predictor.Predictor, recordings.Predicted]:
            """Return what a log says, the model for logs that are printed so, and what it predicts."""
            of_log = model.read_as(beside.of_log(path))
            recording = recordings.read(path, name, of_log.card)
            return recording, of_log, recordings.predict(model, recording, draft)

        with predictions.writing(draft, place, card) as write:
            for recording, of_log, predicted in _each(logs, opened, unread):
                scored = _scored(recording.name, unscored, recordings.scored, of_log, recording)
                summaries.append(write(recording, predicted, scored))
                notes += [f"{recording.name}: {sentence}" for sentence in predicted.notes]
                names.append(recording.name)
                if not given.no_pictures and len(names) <= MOST_PICTURES:
                    of_log_card = of_log.card if scored.get("scores") else None
                    _draw(draft, recording, predicted.values, predictions.file_names(names)[-1], card, of_log_card)
        notes = beside.said + notes
        print(*notes[:MOST_LINES], sep="\n", end="\n" * bool(notes))
        _print(draft, summaries, intervals.sentences(card))
    if len(names) > MOST_PICTURES and not given.no_pictures:
        print(f"the first {MOST_PICTURES} recordings are drawn")
    print(f"written to {target}")
    _end(given, target, logs, unread, unscored)


def of_target(workspace: Workspace, given: argparse.Namespace) -> None:
    """Predict a target of one's own, which is a number or a class for every reading."""
    from tactile.datasets import schemas
    from tactile.inference import predictions
    from tactile.targets import kept, read  # the import of scikit-learn takes a second

    model = kept.load(Path(given.model))
    card = model.card
    print(f"{card.sensor}: {card.target.name} by {card.model}, of {len(card.groups)} groups ({card.by})")
    who = {
        "experiment": card.experiment, "model": f"{card.sensor}: {card.target.name}", "protocol": card.by, "seed": 0,
    }  # fmt: skip
    place, logs, target = _asked(given, card.experiment, who)
    unread, unscored, summaries = [], [], []
    beside = Beside(workspace, card.experiment, f"the model of {card.sensor}", card.settings)

    def table(path: Path, name: str):
        """Return the predictions of a log as rows, and note what they came to."""
        settings = beside.of_log(path)
        log = read.sensor_log(path, card.experiment, settings)
        log = log._replace(reading=read.as_trained(log.reading, settings, card.settings))
        predicted = kept.predict(model, log)
        scored = _scored(name, unscored, kept.scored, path, log, predicted, card)
        summaries.append(kept.summary(name, path, log, predicted, card) | scored)
        return kept.table(name, log, predicted, card)

    with files.replacing_folder(target) as draft:
        schemas.write(draft / predictions.TABLE, kept.schema(card), _each(logs, table, unread))
        unknown = base_cards.UNKNOWN if card.logs is None else ""
        predictions.write_summary(draft, who, place, [kept.interval(card)], summaries, unknown)
        notes = beside.said + [f"{said['recording']}: {words}" for said in summaries for words in said.get("notes", ())]
        print(*notes[:MOST_LINES], sep="\n", end="\n" * bool(notes))
        _print(draft, summaries, [kept.interval(card)], card.target.unit)
    print(f"written to {target}")
    _end(given, target, logs, unread, unscored)


def _scored(name: str, unscored: list[str], scored: Callable[..., dict], *given) -> dict:
    """Return what `scored(*given)` says of the recording `name`; where its truth is of no use, `unscored` gets why."""
    try:
        return scored(*given)
    except InputError as error:
        unscored.append(f"{name}: {error}")
        return {"scores": None, "not_scored": str(error)}


def _print(folder: Path, summaries: list[dict], interval: list[str], unit: str = "") -> None:
    """Print what the recordings came to, and what is to be known of their scores; folder: with summary.json."""
    from tactile.inference import predictions

    for said in summaries[:MOST_LINES]:
        print(sentence(said, unit), *outside(said), sep="\n")
    if len(summaries) > MOST_LINES:
        print(f"and {len(summaries) - MOST_LINES} more recordings, in summary.json")
    if warning := predictions.read_summary(folder).get("warning"):
        print(warning)
    print(*interval, sep="\n")


def _each(logs: Mapping[str, Path], opened: Callable[[Path, str], T], unread: list[str]) -> Iterator[T]:
    """Yield `opened(log, name)` of every log. Where one of several cannot be read, `unread` gets the reason instead.

    Raises InputError where none can be read.
    """
    for name, path in tqdm(logs.items(), desc="predict", unit="log"):
        try:
            found = opened(path, name)
        except InputError as error:
            if len(logs) == 1:
                raise
            unread.append(str(error))
            continue
        yield found
    if len(unread) == len(logs):
        raise InputError(f"none of {len(logs)} logs can be read; the first: {unread[0]}")


def _end(given: argparse.Namespace, target: Path, logs: Mapping, unread: list[str], unscored: list[str]) -> None:
    """Give the answer that --json asks for; list logs that could not be read or scored, and raise InputError."""
    from tactile.inference import predictions

    listed = {"not_read": unread, "not_scored": unscored}
    arguments.answer(given, predictions.read_summary(target) | {"written_to": str(target)} | listed)
    said = {"not_read": "cannot be read", "not_scored": "cannot be scored"}
    for name, sentences in listed.items():
        if sentences:
            print(f"{name.replace('_', ' ')}:", *sentences, sep="\n  ")
    if problems := [f"{len(listed[name])} of {len(logs)} logs {words}" for name, words in said.items() if listed[name]]:
        raise InputError(f"{' and '.join(problems)}; {'the others' if unread else 'all'} are predicted")


def _asked(given: argparse.Namespace, experiment: str, model: Mapping) -> tuple[Path, dict[str, Path], Path]:
    """Return the place of the logs, the logs by name, and where predictions go: --out, else predictions/NAME.

    model: as `predictions.model_of`. Raises InputError where there is no log, or where --out holds something else, or
    predictions/NAME those of another model or of other logs.
    """
    from tactile.inference import predictions, recordings

    place = recordings.absolute(given.logs)
    logs = recordings.logs(place, experiment)
    names = recordings.names(place, logs, experiment)
    folder = place if place.is_dir() else recordings.without_log(place, experiment)
    target = given.out or Path("predictions", *predictions.file_names([folder.name]))
    held = predictions.held(target)
    if given.out is None and held not in (None, predictions.origin(model, place)):
        raise InputError(f"{target}: holds predictions of {held}; give another place by --out, or remove these")
    if target.exists() and held is None:
        raise InputError(f"{target}: holds something else than predictions; give another place by --out")
    return place, dict(zip(names, logs, strict=True)), target


def _draw(folder: Path, recording, values, name: str, card, scored_as) -> None:
    """Draw a recording where it has a prediction; name: of the files, without suffix.

    scored_as: the card by whose settings its truth was read, None where there is no score.
    """
    from tactile.inference import pictures, recordings

    if not any((part == part).any() for part in recordings.parts(values)):
        return
    maps = card.outputs.touch_kpa is not None
    tips = recordings.tips(recording, scored_as) if maps and scored_as else None
    pictures.draw(folder / f"{name}.png", recording, values, card, tips)
    if maps:
        pictures.animate(folder / f"{name}.gif", recording, values, card, tips)


def outside(said: Mapping) -> list[str]:
    """Return the sentence on the readings of a recording outside the training, if it has any; said: its summary."""
    return [f"{said['recording']}: {said['outside_training']}"] if "outside_training" in said else []


def sentence(said: Mapping, unit: str = "") -> str:
    """Say in a line what the predictions of one recording came to; unit: of a target of one's own, see kept.summary."""
    parts = [f"{said['readings']} readings in {said['seconds']:g} s"]
    of_target = said.get("predicted", {})
    if (rejected := sum(said["rejected_lines"].values())) and not of_target:
        parts.append(f"{rejected} lines rejected")
    if "highest_pressure_kpa" in said:
        parts.append(f"up to {said['highest_pressure_kpa']:.0f} kPa and {said['highest_force_n']:.1f} N")
    elif "highest_force_n" in said:
        parts.append(f"up to {said['highest_force_n']:.1f} N")
    if "least" in of_target:
        parts.append(f"{of_target['least']:.4g} to {of_target['most']:.4g} {unit}")
    elif counts := said.get("objects", of_target):
        name, count = next(iter(counts.items()))
        parts.append(f"{name} in {100 * count / said['readings']:.0f} % of them")
    parts += [
        f"{name.removesuffix('_mm')} {span['least']:.2f} to {span['most']:.2f} mm"
        for name, span in said.items()
        if name.endswith("_mm")
    ]
    if reason := said.get("not_scored"):
        parts.append(reason if reason in base_cards.NO_TEST else "not scored, for the reason below")
    words = ", ".join([*parts, *_first_two(said.get("scores"))])
    if (said.get("scores") or {}).get("touches_found") is not None:
        words += f", all tips seen in {100 * said['scores']['touches_found']:.0f} % of the windows that are pressed"
    if test := said.get("held_out_of"):
        words += f"; held out ({test})"
    if held_out := said.get("held_out"):
        words += f": {', '.join(_first_two(held_out))}"
    return f"{said['recording']}: {words}"


def _first_two(scores: Mapping | None) -> list[str]:
    return [f"{name} {value:.3g}" for name, value in list((scores or {}).items())[:2]]
