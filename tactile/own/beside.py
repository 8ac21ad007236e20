"""Read logs as the settings.yaml of their sensor says, where the card of a model says otherwise: `predict`, `live`.

A card says how the logs were read that its model was trained on. Other logs of the same sensor may be printed
otherwise: then their settings go first. Where they say that it is another sensor, the model is of no use, and that is
an error.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import images
from tactile.experiments import facts, log_name
from tactile.logs import layout
from tactile.own import settings as own_settings

LEVELS = 3  # folders above a log in which the settings may lie: <folder>/<condition>/<recording>/array.log
ORDER, FORMAT = "sensor.order", "ingest.format"
OF_MAPS = ("sensor.pitch_mm", "sensor.element_mm")  # of touch, for models that tell places
USUAL = {"sensor.unit": "V", "sensor.scale": "frame", ORDER: [], "ingest.clock": "own"}  # of keys that may be left out
RISES = "rises_when_pressed"


class Beside:
    """The settings beside logs, for one model. `said`: sentences on what is taken from them, each once."""

    def __init__(self, workspace: Workspace, experiment: str, who: str, reading: Mapping[str, Mapping]):
        """Take what the card says: who: the model's name; reading: blocks of settings by which its logs were read."""
        self.workspace, self.experiment, self.who, self.reading = workspace, experiment, who, reading
        self.said: list[str] = []
        self._known: dict[Path, Mapping] = {}

    def of_log(self, log: Path) -> Mapping[str, Mapping]:
        """Return the blocks by which a log is read: those of the card where no settings.yaml lies above it.

        Raises InputError where the settings are wrong, or are of another sensor than the model's.
        """
        above = list(log.absolute().parents)[:LEVELS] if log_name(self.experiment) else []
        folder = next((folder for folder in above if (folder / own_settings.FILE).is_file()), None)
        return self.reading if folder is None else self.of_folder(folder)

    def of_folder(self, folder: Path) -> Mapping[str, Mapping]:
        """Return the blocks by which logs of the sensor in a folder are read; errors as `of_log`."""
        if folder not in self._known:
            if not (folder / own_settings.FILE).is_file():
                raise InputError(f"{folder / own_settings.FILE}: not found; name the folder of the sensor")
            self._known[folder] = self._merged(folder)
        return self._known[folder]

    def _merged(self, folder: Path) -> Mapping[str, Mapping]:
        where, key = _shown(folder / own_settings.FILE), f"{self.experiment}.{{}}".format
        given = own_settings.leaves(own_settings.of_sensor(folder))
        resolved = own_settings.of_logs(self.workspace, self.experiment, folder)[self.experiment]

        def has(dotted: str) -> bool:
            return any(name == key(dotted) or name.startswith(f"{key(dotted)}.") for name in given)

        for dotted in (*facts(self.experiment).sensor, *(OF_MAPS if "label" in self.reading else ())):
            here, trained = (_value(block, dotted) for block in (resolved, self.reading))
            if has(dotted) and trained is not None and here != trained:
                raise InputError(
                    f"{where}: {key(dotted)} is {_text(here)}, but {self.who} was trained on a sensor with "
                    f"{_text(trained)}; take a model of this sensor, or correct the key"
                )
        merged, changed = {name: dict(block) for name, block in self.reading.items()}, []
        for dotted in facts(self.experiment).layout:
            here, trained = (_value(block, dotted) for block in (resolved, self.reading))
            block, _, name = dotted.partition(".")
            if has(dotted):
                merged.setdefault(block, {})[name] = here
                changed += [key(dotted)] * (here != trained)
            elif dotted == ORDER and trained:
                self.said.append(f"{where} does not say {key(ORDER)}: taken as {self.who} was trained")
        if has(FORMAT):
            changed += list(self._format(where, resolved["ingest"]["format"], merged.setdefault("ingest", {})))
        elif layout.of(self.reading.get("ingest", {}), log_name(self.experiment)):
            self.said.append(f"{where} does not say {key(FORMAT)}: taken as {self.who} was trained")
        self._check_order(where, merged)
        if changed:
            self.said.append(f"read as {where} says, not as {self.who} was trained: {', '.join(changed)}")
        return merged

    def _format(self, where: str, formats: Mapping, ingest: dict) -> Iterator[str]:
        """Put the layouts of logs into `ingest`, and yield the names of those that are not as the card says.

        Raises InputError where the sensor's readings fall when pressed, and those of the training did not, or the
        other way round.
        """
        key, log = f"{self.experiment}.{FORMAT}", log_name(self.experiment)
        here, trained = layout.of({"format": formats}, log), layout.of(ingest, log)
        signs = [(block or {}).get(RISES, True) for block in (here, trained)]
        if here is not None and signs[0] != signs[1]:
            raise InputError(
                f"{where}: {key}, {log}, {RISES} is {_text(signs[0])}, but {self.who} was trained on readings with "
                f"{_text(signs[1])}; take a model of this sensor, or, where it is the same one and only its log is "
                f"turned, write {RISES}: {_text(signs[1])} with `scale: -1` and `offset`, lowest + highest reading"
            )
        for name, block in formats.items():
            if block != ingest.get("format", {}).get(name):
                yield f"{key} ({name})"
        ingest["format"] = {**ingest.get("format", {}), **formats}

    def _check_order(self, where: str, reading: Mapping) -> None:
        """Raise InputError where an order does not name each printed column once."""
        order = _value(reading, ORDER) if ORDER in facts(self.experiment).layout else []
        elements = reading["sensor"]["rows"] * reading["sensor"]["cols"] if order else 0
        if sorted(order) != list(range(elements)):
            raise InputError(
                f"{where}: touch.sensor.order names {len(order)} columns; it has to name each of 0 to {elements - 1} "
                "once, in the order of the elements, or none ([])"
            )


def _value(reading: Mapping, dotted: str):
    """Return a setting, with what it comes to where it is left out; of areas as images.areas."""
    block, _, name = dotted.partition(".")
    if dotted == "sensor.areas":
        return list(images.areas(reading).items())
    return reading.get(block, {}).get(name, USUAL.get(dotted))


def _text(value) -> str:
    """Return a setting as a sentence has it."""
    if isinstance(value, list):
        return ", ".join(
            f"{name} {area.rows} x {area.cols} ({area.lowest:g} to {area.highest:g})" for name, area in value
        )
    return str(value).lower() if isinstance(value, bool) else str(value)


def _shown(path: Path) -> str:
    """Return a path as seen from the working directory."""
    path = path.absolute()
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
