"""Turn recordings, read as ingest reads them, into the one form that the sheet sees: `cycles.Sensor`.

A folder of logs gives readings as they were printed. Of the simulated array and of the recorded taxel, whose circuits
are known, readings are conductances in mS, so that they can stand side by side.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from tactile import experiments
from tactile.base.errors import InputError
from tactile.datasets import images, schemas, specimens
from tactile.experiments import glove
from tactile.experiments.strain_recorded import SHARED
from tactile.experiments.touch import RESISTANCE
from tactile.experiments.velostat_recorded import RASTER, STEP_MM
from tactile.sheet import cycles
from tactile.sheet.cycles import Log, Sensor

LEAST_MM = 0.2  # an arm that moves less along an axis rests


def sensors(experiment: str, name: str, folder: Path, settings: Mapping, simulated: bool = False) -> list[Sensor]:
    """Return the sensors of a folder of logs: one, or one for each area of a glove.

    experiment, settings: its name and its block of settings; name: what the sensor is called; simulated: the folder
    holds the logs of the scene. Raises InputError as ingest does.
    """
    module = experiments.module(experiment)
    if not module.FACTS.stream:
        raise InputError(f"{experiment}: its frames do not follow one another, so that there is no data sheet of it")
    paths = [path for path in module.recordings(folder) if not simulated or of_first_specimen(experiment, path.name)]
    chosen = [path for path in paths if getattr(module, "shows_loading", all_alike)(path, settings)] or paths
    read = [module.read_recording(path, settings)[0] for path in chosen]
    made = of_frames(experiment, name, [frames for frames in read if frames.num_rows], settings, simulated)
    if not any(sensor.logs for sensor in made):
        raise InputError(f"{folder}: no recording has frames; `tactile check {experiment} {folder}` says more")
    return made


def of_frames(
    experiment: str, name: str, read: Sequence[pa.Table], settings: Mapping, simulated: bool = False
) -> list[Sensor]:
    """Return the sensors of recordings that have been read, by the function that the facts of the experiment name."""
    return globals()[experiments.facts(experiment).sheet](name, read, settings, simulated)


def of_first_specimen(experiment: str, name: str) -> bool:
    """Tell whether a simulated recording is of the first specimen, by its name: a sheet is of one sensor.

    Fingers have a recording each; of arrays and gloves the name says the number.
    """
    first = experiments.facts(experiment).first
    return name == first if first else specimens.number(name) == 0


def all_alike(path: Path, settings: Mapping) -> bool:
    """Tell that a recording is needed."""
    return True


def array(name: str, read: Sequence[pa.Table], settings: Mapping, simulated: bool) -> list[Sensor]:
    """Return an array, or a single element, under a load cell; several touches at a time are no loading cycle."""
    sensor, resistance, logs = settings["sensor"], RESISTANCE in settings["ingest"], []
    for frames in read:
        force = schemas.matrix(frames["force_n"])
        reading = schemas.matrix(frames["v"]).astype(float)
        if resistance:
            reading = 1e3 / reading
        elif simulated:
            circuit = settings["simulate"]["circuit"]
            reading = 1e3 * glove.conductance(reading, circuit["reference_ohm"], circuit["adc_levels"])
        place = np.column_stack([schemas.matrix(frames[axis])[:, 0] for axis in ("x_mm", "y_mm")])
        one_tip = not np.isfinite(force[:, 1:]).any()
        logs.append(log_of(frames, reading, force[:, 0].astype(float) if one_tip else np.empty(0), place.astype(float)))
    several = sensor["rows"] * sensor["cols"] > 1
    return [
        Sensor(
            name,
            "mS" if simulated or resistance else "counts",
            "N",
            logs,
            settings["ingest"].get("clock") == "shared",
            (sensor["rows"], sensor["cols"]) if several else None,
            sensor.get("pitch_mm", np.nan),
        )
    ]


def strands(name: str, read: Sequence[pa.Table], settings: Mapping, simulated: bool) -> list[Sensor]:
    """Return strands on an arm; the stimulus is the depth, or the one axis along which the arm moves.

    Where some recordings move along one axis alone, the others are left out; where none does, only presses count
    during which z alone moves. The depth is that below `sensor.pressed_below_mm`, or else below the highest z.
    """
    places = [schemas.matrix(frames["y_mm"]).astype(float) for frames in read]
    moving = [np.ptp(place, axis=0) > LEAST_MM for place in places]
    axes = {int(moves.argmax()) for moves in moving if moves.sum() == 1}
    axis = min(axes) if axes and 2 not in axes else 2
    chosen = [k for k, moves in enumerate(moving) if moves[axis] and moves.sum() == 1] or range(len(read))
    logs, below = [], settings["sensor"].get("pressed_below_mm")
    for k in chosen:
        along = -places[k][:, 2] if axis == 2 else places[k][:, axis]
        start = along.min() if below is None or axis != 2 else -below
        others = np.delete(places[k], axis, axis=1)
        stimulus = np.maximum(along - start, 0.0)
        logs.append(log_of(read[k], schemas.matrix(read[k]["v"]).astype(float), stimulus, others))
    unit = settings["sensor"].get("unit", "V")
    return [Sensor(name, unit, "mm", logs, settings["ingest"].get("clock") == "shared")]


def areas_of_glove(name: str, read: Sequence[pa.Table], settings: Mapping, simulated: bool) -> list[Sensor]:
    """Return a sensor for each area; no log says how hard its cells are pressed."""
    made = []
    areas = images.areas(settings)
    for area in areas:
        logs = [bare(frames, schemas.matrix(frames[area]).astype(float)) for frames in read]
        unit = "counts" if glove.scale(settings) == glove.PER_FRAME else "units"
        made.append(Sensor(f"{name}, {area}" if len(areas) > 1 else name, unit, "", logs))
    return made


def taxel(name: str, read: Sequence[pa.Table], settings: Mapping, simulated: bool) -> list[Sensor]:
    """Return the recorded taxel; where a recording has one press for each place of the raster, places are known.

    Readings are resistances in ohm if the reference of the taxel's reader has 1 kohm.
    """
    columns, steps = RASTER[1], STEP_MM
    (sensor,), logs = array(name, read, settings, simulated), []
    for log in sensor.logs:
        place, rest = log.place, np.percentile(log.stimulus, 10)
        log = log._replace(stimulus=log.stimulus - rest)
        top = cycles.full_scale(Sensor(name, "", "N", [log]))
        found = cycles.presses(log.time_s, log.stimulus, cycles.REST * top, cycles.BRIEFEST_S)
        if len(found) == np.prod(RASTER):
            middle = [(a.stop + b.first) // 2 for a, b in zip(found, found[1:], strict=False)]
            number = np.searchsorted(middle, np.arange(len(place)), side="right")
            place = np.column_stack([number // columns * steps[0], number % columns * steps[1]]).astype(float)
        logs.append(log._replace(place=place))
    return [sensor._replace(logs=logs, note="The taxel's conductance: 1000 over the printed reading.")]


def recorded_strands(name: str, read: Sequence[pa.Table], settings: Mapping, simulated: bool) -> list[Sensor]:
    """Return the five strands that both days have; the arm's depth is commanded, its places are random."""
    logs = []
    for frames in read:
        day = frames["condition"][0].as_py()
        reading = schemas.matrix(frames["v"])[:, SHARED[day]].astype(float)
        place = schemas.matrix(frames["y_mm"]).astype(float)
        logs.append(log_of(frames, reading, -place[:, 2], place[:, :2]))
    note = "The stimulus is the commanded depth: what the arm needs to follow it is in all times."
    return [Sensor(name, "V", "mm", logs, one_clock=True, note=note)]


def hand(name: str, read: Sequence[pa.Table], settings: Mapping, simulated: bool) -> list[Sensor]:
    """Return the hand's tactile matrices; its joint angles are those of encoders, no tactile sensor."""
    return [
        Sensor(name, "counts", "", [bare(frames, schemas.matrix(frames["pressure"]).astype(float)) for frames in read])
    ]


def log_of(frames: pa.Table, reading: np.ndarray, stimulus: np.ndarray, place: np.ndarray) -> Log:
    """Return a recording of a frames table, in the order of time."""
    group, name = frames["condition"][0].as_py(), frames["recording"][0].as_py()
    return Log(f"{group}/{name}", group, frames["t_s"].to_numpy(), reading, stimulus, place)


def bare(frames: pa.Table, reading: np.ndarray) -> Log:
    """Return a recording without a stimulus."""
    return log_of(frames, reading, np.empty(0), np.empty((0, 2)))
