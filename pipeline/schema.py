"""What params.yaml may say: every block, key, kind and range.

A model's block is checked against the signature of its `build` (pipeline/params.py), whose annotations are the kinds
at the end of the first part below, so that a new model needs no edit here.
"""

from collections.abc import Callable, Mapping
from typing import Annotated

Check = Callable[[object], str | None]
LONGEST_LIST = 1000


def number(low: float = -1e12, high: float = 1e12) -> Check:
    """A check that accepts any number in [low, high]."""

    def check(value):
        if isinstance(value, bool) or not isinstance(value, int | float):
            return "a number"
        return None if low <= value <= high else f"a number from {low:g} to {high:g}"  # nan is in no range

    return check


def integer(low: int, high: int = 1_000_000) -> Check:
    """A check that accepts whole numbers in [low, high]."""

    def check(value):
        whole = isinstance(value, int) and not isinstance(value, bool)
        return None if whole and low <= value <= high else f"a whole number from {low} to {high}"

    return check


def flag(value):
    """true or false."""
    return None if isinstance(value, bool) else "true or false"


def text(value):
    """Any non-empty text."""
    return None if isinstance(value, str) and value else "text"


def one_of(*choices: str | int) -> Check:
    """A check that accepts exactly these words or numbers."""
    expected = f"one of {', '.join(map(str, choices))}"
    return lambda value: None if not isinstance(value, bool) and value in choices else expected


def many(item: Check) -> Check:
    """A check that accepts a non-empty list without repeats whose entries all pass `item`."""

    def check(value):
        if wrong := listed(value):
            return wrong
        return "a list without repeats" if len(set(value)) < len(value) else None

    listed = ordered(item)
    return check


def ordered(item: Check) -> Check:
    """A check that accepts a list of 1 to LONGEST_LIST entries that all pass `item`; entries may repeat."""

    def check(value):
        if not isinstance(value, list) or not value:
            return "a non-empty list"
        if len(value) > LONGEST_LIST:
            return f"a list of at most {LONGEST_LIST} entries"
        return next((f"a list of which each is {wrong}" for wrong in map(item, value) if wrong), None)

    return check


def mapping(value):
    """A non-empty block whose keys are free (models)."""
    return None if isinstance(value, Mapping) and value else "a non-empty block"


def severities(value):
    """A non-empty block: names of perturbations, each with a list of severities other than 0."""
    if wrong := mapping(value):
        return wrong
    listed = many(number(-1e6, 1e6))
    for name, levels in value.items():
        if (wrong := listed(levels)) or 0 in levels:
            return f"for {name} {wrong or 'no severity 0 (it is always done)'}"
    return None


positive = number(1e-12, 1e12)
fraction = number(0.0, 1.0)
not_negative = number(0.0, 1e12)
seed = integer(0, 2**15 - 1)  # predictions keep seeds in 16 bits
rate_hz = number(1e-3, 1e5)
learning_rate = number(1e-9, 10.0)

# The settings of models, for the annotations of `build`. The limits keep a slip of the pen from asking for more memory
# than a machine has; each is ten times or more what any model here has.
Count = Annotated[int, integer(1, 100_000)]
Width = Annotated[int, integer(1, 8192)]  # units of a layer
Widths = Annotated[list, ordered(integer(1, 8192))]
Layers = Annotated[int, integer(1, 32)]
Degree = Annotated[int, integer(1, 5)]
Taps = Annotated[int, integer(2, 100)]  # a filter without a constant needs 2
Neighbours = Annotated[int, one_of(4, 8)]
Reduction = Annotated[int, integer(1, 64)]
Number = Annotated[float, number(-1e6, 1e6)]
NotNegative = Annotated[float, not_negative]
Positive = Annotated[float, positive]
Share = Annotated[float, number(1e-6, 1.0)]
EarlyStopping = Annotated[
    dict,
    {
        "learning_rate": learning_rate,
        "batch_size": integer(1),
        "max_epochs": integer(1),
        "patience": integer(1),
        "plateau": integer(1),
        "drop": number(1e-6, 1.0),  # 1 keeps the learning rate
    },
]
SequenceTraining = Annotated[
    dict,
    {
        "learning_rate": learning_rate,
        "max_epochs": integer(1),
        "drop_epoch": integer(1),
        "drop": number(1e-6, 1.0),
        "clip": positive,
        "streams": integer(1),
        "batch": integer(1),
    },
]
StretchTraining = Annotated[
    dict,
    {
        "learning_rate": learning_rate,
        "max_epochs": integer(1),
        "batch": integer(1),
        "length": integer(1),
        "warm_up": integer(0),
        "clip": positive,
    },
]
AugmentedTraining = Annotated[
    dict,
    {
        "learning_rate": learning_rate,
        "batch_size": integer(1),
        "max_epochs": integer(1),
        "flip": fraction,
        "noise": fraction,
        "affine": fraction,
    },
]

one = integer(1, 1)  # the recordings are of one taxel
window = {
    "frames": integer(1, 10_000),
    "frame_step": integer(1, 10_000),
    "stride": integer(1),
    "contact_threshold_n": positive,
}
seeds = {"seeds": many(seed)}
taxel_recordings = ["pike1", *(f"pike1_force_{newton}" for newton in (1, 5, 10, 20, 30, 40)), "pike5_force_20"]
line_faults = dict.fromkeys(("torn", "duplicated", "missing", "out_of_range", "out_of_order"), fraction)
tactile_images = ("pressure", "strain", "combined")
stress = {"protocols": many(text), "perturbations": severities}
latency = {"batches": many(integer(1, 65536)), "threads": integer(1, 1024), "warm_up": integer(0), "calls": integer(1)}


def ablation(*protocols: str) -> dict:
    """The block of `physics` for one experiment; `scene` is held against the experiment's schema when it is used."""
    return {
        "floor_seeds": many(seed),
        "effect_seeds": many(seed),
        "protocols": many(one_of(*protocols)),
        "scene": mapping,
        "models": mapping,
    }


SCHEMA = {
    "experiments": many(one_of("touch", "velostat_recorded", "strain", "strain_recorded", "glove", "glove_recorded")),
    "device": one_of("auto", "cpu", "cuda"),
    "touch": {
        "source": text,
        "sensor": {"rows": integer(1, 256), "cols": integer(1, 256), "pitch_mm": positive, "element_mm": positive},
        "yardstick": {"model": text, "condition": text, "metric": text, "published": positive},
        "simulate": {
            "seed": integer(0, 2**31),
            "single": {
                "points_per_side": integer(1),
                "depths": integer(1),
                "repetitions": integer(1),
                "presses_per_recording": integer(2),
            },
            "double": {"recordings": integer(1), "presses_per_recording": integer(2)},
            "demonstrations": {"repetitions": integer(1)},
            "pressure": {"lowest_kpa": positive, "highest_kpa": positive, "location_spread": fraction},
            "press": {
                "approach_s": positive,
                "hold_s": positive,
                "release_s": positive,
                "travel_s": positive,
                "timing_spread": fraction,
            },
            "hand": {"slower": positive, "shift_mm": number(0), "tilt_deg": number(0, 45)},
            "contact": {"silicone_spread_mm": number(0)},
            "material": {"resistance_scale_ohm": positive, "gain_spread": number(0), "exponent_spread": number(0)},
            "circuit": {
                "supply_v": positive,
                "reference_ohm": positive,
                "adc_levels": integer(2, 2**31),
                "noise_counts": number(0),
            },
            "devices": {
                "array_hz": rate_hz,
                "load_cell_hz": rate_hz,
                "cnc_hz": rate_hz,
                "force_noise_n": number(0),
                "clock_offset_s": number(0),
                "clock_drift_ppm": number(0),
            },
            "faults": line_faults | {"resets": integer(0)},
            "effects": {
                "load_sharing": flag,
                "creep": flag,
                "hysteresis": flag,
                "release": flag,
                "element_spread": flag,
                "crosstalk": flag,
                "noise": flag,
                "hand_error": flag,
                "line_faults": flag,
            },
        },
        "ingest": {
            "max_reject_fraction": fraction,
            "max_clock_offset_s": positive,
            "min_correlation": fraction,
            "max_touches": integer(1),
            "highest_count": integer(1, 2**31 - 1),
        },
        "window": window,
        "label": {"tip_radius_mm": positive, "map_rows": integer(1, 1024), "map_cols": integer(1, 1024)},
        "split": {"seed": seed, "train": fraction, "validation": fraction},
        "protocols": {"press": seeds, "random_window": seeds},
        "models": mapping,
        "latency": latency,
    },
    "strain": {
        "source": text,
        "sensor": {"channels": integer(1, 1024)},
        "yardstick": {"model": text, "condition": text, "metric": text, "published": positive},
        "simulate": {
            "seed": integer(0, 2**31),
            "samples": integer(100, 10_000_000),
            "motion": {
                "width_mm": positive,
                "height_mm": positive,
                "depth_mm": positive,
                "sliding_depth_mm": positive,
                "slide_slowest_mm_s": positive,
                "slide_fastest_mm_s": positive,
                "press_slowest_mm_s": positive,
                "press_fastest_mm_s": positive,
                "rest_s": number(0),
            },
            "finger": {
                "stiffness_n_per_mm": positive,
                "normal_n_per_mm": positive,
                "static_friction": number(0),
                "kinetic_friction": number(0),
                "press_bending": number(),
                "compression": number(),
                "lean": number(),
            },
            "strand": {
                "sensitivity_per_mm": positive,
                "gain_spread": number(0),
                "angle_spread_deg": number(0),
                "fast_share": fraction,
                "fast_time_s": positive,
                "slow_share": fraction,
                "slow_time_s": positive,
                "loading_time_s": positive,
                "unloading_time_s": positive,
            },
            "drift": {"walk_per_root_hour": number(0), "ageing": number(), "ageing_time_s": positive},
            "circuit": {"supply_v": positive, "reference_share": positive, "noise_v": number(0)},
            "devices": {
                "daq_hz": rate_hz,
                "robot_hz": rate_hz,
                "jitter_s": number(0),
                "clock_offset_s": number(0),
                "clock_drift_ppm": number(0),
            },
            "faults": line_faults | {"gaps": integer(0), "gap_s": number(0)},
            "effects": {
                "relaxation": flag,
                "asymmetry": flag,
                "drift": flag,
                "noise": flag,
                "stick_slip": flag,
                "jitter": flag,
                "line_faults": flag,
            },
        },
        "ingest": {
            "rate_hz": rate_hz,
            "max_reject_fraction": fraction,
            "max_clock_offset_s": positive,
            "min_correlation": fraction,
            "max_gap_s": positive,
        },
        "window": {"frames": integer(1, 10_000)},
        "split": {"train": fraction, "validation": fraction},
        "model_zero": text,
        "protocols": {"task_0": seeds, "task_1": seeds, "task_2": seeds},
        "models": mapping,
        "study": {
            "tasks": many(one_of("task_1", "task_2")),
            "seeds": many(seed),
            "samples": many(integer(2)),
            "models": many(one_of("lstm_direct", "lstm_transfer", "lstm_transfer_ridge")),
            "capacity": {
                "units": many(integer(1, 8192)),
                "training": {
                    "max_epochs": integer(1),
                    "drop_epoch": integer(1),
                    "streams": integer(1),
                    "batch": integer(1),
                },
            },
        },
        "latency": latency,
    },
    "strain_recorded": {
        "ingest": {"every": integer(1), "max_reject_fraction": fraction},
        "window": {"frames": integer(1, 10_000)},
        "split": {"train": fraction, "validation": fraction},
        "model_zero": text,
        "protocols": mapping,
        "models": mapping,
        "latency": latency,
    },
    "velostat_recorded": {
        "sensor": {"rows": one, "cols": one},
        "label": {"map_rows": one, "map_cols": one},
        "ingest": {"max_reject_fraction": fraction},
        "window": window,
        "split": {"validation": fraction},
        "protocols": {"repetition": seeds} | dict.fromkeys(taxel_recordings, seeds),
        "models": mapping,
        "latency": latency,
    },
    "glove": {
        "source": text,
        "sensor": {"reference_ohm": positive},
        "yardstick": {"model": text, "condition": text, "metric": text, "published": positive},
        "simulate": {
            "seed": integer(0, 2**31),
            "sessions": integer(1),
            "frames_per_object": integer(1),
            "frame_hz": rate_hz,
            "session": {
                "along_mm": number(0),
                "across_mm": number(0),
                "tilt_deg": number(0),
                "margin": positive,
                "margin_spread": number(0),
                "share_spread": number(0),
                "fit_deg": number(0),
                "least_grip_n": number(0),
                "wander": number(0),
                "wander_time_s": positive,
            },
            "film": {
                "rest_ohm": positive,
                "force_scale": positive,
                "gain_spread": number(0),
                "rest_bend_ohm": positive,
                "bend_gain": number(0),
            },
            "circuit": {"supply_v": positive, "noise_counts": number(0)},
            "faults": line_faults,
            "effects": {
                "session": flag,
                "wander": flag,
                "element_spread": flag,
                "softness": flag,
                "noise": flag,
                "line_faults": flag,
            },
        },
        "ingest": {"max_reject_fraction": fraction},
        "window": {"stride": integer(1)},
        "split": {"train": fraction, "validation": fraction},
        "protocols": dict.fromkeys(
            [f"{split}_{images}" for split in ("session", "random_frames") for images in tactile_images], seeds
        ),
        "models": mapping,
        "augmentation": {"model": text, "split": text, "seeds": many(seed)},
        "stag": {"file": text, "seeds": many(seed), "validation": fraction},
        "latency": latency,
    },
    "glove_recorded": {
        "ingest": {"max_reject_fraction": fraction},
        "window": {"frames": integer(1), "stride": integer(1)},
        "split": {"train": fraction, "validation": fraction},
        "protocols": mapping,
        "models": mapping,
        "latency": latency,
    },
    "stress": {
        **dict.fromkeys(("touch", "velostat_recorded", "strain", "strain_recorded"), stress),
        **dict.fromkeys(("glove", "glove_recorded"), stress | {"seeds": many(seed)}),
    },
    "physics": {
        "touch": ablation("press"),
        "strain": ablation("task_1", "task_2"),
        "glove": ablation(*(f"session_{images}" for images in tactile_images)),
    },
    "rightsize": {
        "touch": {
            "lomp": seeds | {"sizes": many(integer(1, 8192))},
            "window": seeds | {"sizes": many(integer(1)), "training": {"max_epochs": integer(1)}},
        },
        "glove": {"sp_resnet": seeds | {"sizes": many(number(1 / 64, 1.0))}},
    },
}
SPLIT_IN_THREE = ("touch", "glove", "glove_recorded")  # elsewhere the validation part is a share of the training part
