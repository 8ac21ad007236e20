"""Name experiments, models, perturbations, effects and columns as the reports do."""

from tactile.experiments import NAMES, facts
from tactile.settings.stress import TESTS

FRONTS = {"p50_ms": "speed_front", "train_s": "training_front"}  # measured time -> the column of its Pareto front
TIMES = {"p50_ms": "Median time of a prediction (ms)", "train_s": "Training time (s)"}  # -> its axis
MACHINES = {"p50_ms": "machine", "train_s": "training_machine"}  # -> the column of what it was measured on
SPREAD = {"p50_ms": ["p50_low_ms", "p50_high_ms"], "train_s": ["train_low_s", "train_high_s"]}  # -> its least and most
LABELS = {
    "constant": "Constant (mean)",
    "linear": "Linear",
    "poly": "Polynomial",
    "tree": "Decision tree",
    "linear_array": "Linear, whole array",
    "poly_array": "Polynomial, whole array",
    "tree_array": "Decision tree, whole array",
    "rbf": "RBF-Net",
    "cnn": "CNN",
    "vgg": "VGG-16",
    "convlstm": "ConvLSTM",
    "rnn": "RNN",
    "lomp": "LoMP",
    "lomp_stream": "LoMP streaming",
    "lomp_shared": "LoMP, one read-out",
    "ridge": "Ridge, raw window",
    "esn": "Echo state network",
    "lstm_direct": "LSTM, direct",
    "lstm_transfer": "LSTM, transfer (Adam)",
    "lstm_highpass": "LSTM on high-passed voltages",
    "press_difference": "Extra trees, press minus rest",
    "lstm_transfer_ridge": "LSTM, transfer (closed form)",
    "window_ridge": "Ridge, window statistics",
    "window_trees": "Extra trees, window statistics",
    "naive_bayes": "Naive Bayes",
    "resnet18": "ResNet-18",
    "mobilenet": "MobileNet",
    "resnet3x3": "ResNet_3x3",
    "sp_resnet_nogcam": "SP-ResNet (no GCAM)",
    "sp_resnet": "SP-ResNet",
}

MEASURES = {"rmse": "RMSE", "error": "Error", "accuracy": "Accuracy"}  # that models are compared by
CONDITIONS = {  # condition -> what is tested; others are words already
    "single": "one touch",
    "single_anew": "one touch, at new places",
    "several": "several touches at once",
    "double": "two touches",
    "three": "three touches",
    "slide": "two sliding touches",
    "tape": "rolled tape",
    "pressure": "pressure",
    "strain": "bending",
    "combined": "pressure and bending",
    "xy": "place",
    "z": "depth",
    "xyz": "place and depth",
}
FOLDS = {"fold": "fitted to one contact", "two_too": "fitted to two contacts, too"}  # folds, without their number
PERTURBATIONS = {  # stress test -> its name, and what it does
    "noise": ("noise", "white noise; standard deviation as share of the sensor's range"),
    "gain_drift": ("drift of gains", "each element's response scaled; standard deviation of the log of the factor"),
    "offset_drift": ("drift of offsets", "each element shifted; standard deviation as share of the sensor's range"),
    "dead": ("dead elements", "elements that read the lowest value; strands of strain come loose and read the supply"),
    "half": ("elements that die half way", "as dead elements, but only from the middle of the test part on"),
    "stuck": ("stuck elements", "elements that repeat one old reading"),
    "dead_line": ("dead rows or columns", "rows or columns that read the lowest value"),
    "lost_frames": ("lost frames", "share of frames lost; the one before is repeated"),
    "jitter": ("uneven sampling", "frames taken early or late; standard deviation in frames"),
    "specimen": ("another sensor", "number of another sensor of the same make"),
    "peak_pressure": ("higher pressure", "all pressures times 1 + severity"),
    "press_speed": ("speed of a press", "presses faster or slower by 2 to the severity"),
    "tip_radius": ("radius of the tip", "change of the tip's radius in mm; the labels go with it"),
    "touches": ("more touches at once", "touches at once"),
    "distance": ("distance of two touches", "distance in mm between two touches"),
    "time": (
        "time since the test part began",
        "age of the samples in minutes since the start of the test part; nothing is perturbed",
    ),
    "rate": ("sampling rate", "sampling rate changed by 2 to the severity"),
    "speed": ("speed of motion", "motion faster or slower by 2 to the severity"),
    "shift": ("shifted object", "the object lies nearer to the fingers by so many mm"),
    "turn": ("turned object", "the object lies turned on the palm by so many degrees"),
    "grip": ("strength of the grip", "margin of the grip over the slip force times 2 to the severity"),
}
FORMS = {  # as input_frames.csv calls them: how a network predicts from several input frames
    "trained": "one network trained on all frames",
    "mean": "mean prediction of a one-frame network",
}
EFFECTS = {  # of the simulated scenes
    "load_sharing": "sharing of the load among elements",
    "contact_growth": "growth of the contact area with force",
    "places": "differences between places of the film",
    "repeats": "differences between repeats of a press",
    "creep": "creep",
    "slow_creep": "slow creep",
    "hysteresis": "hysteresis",
    "release": "overshoot after a release",
    "crosstalk": "crosstalk within a column",
    "row_sag": "sag of the row voltage",
    "scan_time": "time between elements of a scan",
    "noise": "noise",
    "hand_error": "error of the hand's place",
    "line_faults": "faulty lines in the log",
    "relaxation": "relaxation of the strands",
    "asymmetry": "asymmetry of loading and unloading",
    "drift": "drift",
    "stick_slip": "stick-slip friction",
    "friction_spread": "spread of the friction",
    "jitter": "uneven sampling",
    "session": "differences between sessions",
    "wander": "wandering load within a grasp",
    "element_spread": "differences between elements",
    "softness": "softness of the objects",
}
STATISTICS = {  # of recordings and scenes; others are words already
    "loading_loop": "loop of loading and unloading",
    "place_spread": "spread between places",
    "rest_spread": "spread of the rest",
    "creep_press": "creep within a press",
    "creep_long": "creep within a long press",
    "overshoot": "overshoot after a release",
    "recovery": "overshoot left after 2 s",
    "r2_present": "R2 of the force from the present",
    "r2_past": "R2 of the force from the past, too",
    "gain_from_past": "gain in R2 from the past",
    "repeatability": "spread between repetitions",
    "gain_spread": "spread of gain between elements",
    "beside": "reading beside a contact",
    "along_line": "reading along its row and column",
    "crossing": "reading where lines of contacts cross",
    "two_over_one": "one of two contacts over one alone",
    "in_row": "two contacts in a row",
    "in_column": "two contacts in a column",
    "drift_over_response": "drift over response",
    "drift_growth": "growth of the drift in 20 min",
    "drift_correlation": "correlation of drifts between strands",
    "time_share": "variance explained by time",
    "rest_over_response": "spread of the rest over response",
    "rest_correlation": "correlation of rests between strands",
    "rest_memory_near": "correlation of rests, next press",
    "rest_memory_far": "correlation of rests, 20 presses on",
    "history_share": "R2 of the rest from earlier presses",
    "hold_change": "change while a press is held",
    "place_r2_absolute": "R2 of the place from voltages",
    "place_r2_difference": "R2 of the place, rest subtracted",
    "effective_rank": "independent strands",
    "active_cells": "share of active cells",
    "alike_within": "likeness of grasps of an object",
    "alike_others": "likeness of other objects",
    "load_spread": "spread of the load between grasps",
    "load_wander": "spread of the load within a grasp",
    "held_share": "variance within a held grasp",
    "shift": "shift of the contact between grasps",
    "joint_spread": "spread of joint angles",
    "pressure_between": "variance of pressure between objects",
    "joint_between": "variance of angles between objects",
    "rank": "rank of patterns per object",
    "tree_grasps": "accuracy of a tree, new grasps",
    "tree_frames": "accuracy of a tree, random frames",
}


def model_name(model: str) -> str:
    """Return the name of a model in tables and sentences: as the paper prints it, or its key where there is none."""
    return LABELS.get(model, model)


def experiment_name(experiment: str) -> str:
    """Return the name of an experiment in headings."""
    return facts(experiment).label if experiment in NAMES else plain(experiment)


def condition_name(experiment: str, protocol: str, condition: str) -> str:
    """Return what a stability test was done on, in words."""
    if name := facts(experiment).tested.get((protocol, condition)):
        return name
    said = condition in ("all", protocol) or protocol.endswith(f"_{condition}")
    return split_name(protocol) if said else f"{split_name(protocol)}, {task_name(condition)}"


def task_name(condition: str) -> str:
    """Return what a condition tests, in words."""
    return CONDITIONS.get(condition, plain(condition))


def split_name(protocol: str) -> str:
    """Return a protocol in words; of one that ends in a condition, `session_strain`, that has its name."""
    split, _, condition = protocol.rpartition("_")
    return f"{plain(split)}, {CONDITIONS[condition]}" if split and condition in CONDITIONS else plain(protocol)


def perturbation(key: str) -> tuple[str, str, str]:
    """Return the name of a stress test, the unit of its severity, and what it does."""
    unit, meaning = {name: test for _, name, test in TESTS}.get(key, ("severity", "see `stress` in params.yaml"))
    name, does = PERTURBATIONS.get(key, (plain(key), meaning[:1].lower() + meaning[1:].rstrip(".")))
    return name, unit, does


def effect_name(effect: str) -> str:
    """Return the name of an effect of a simulated scene."""
    return EFFECTS.get(effect, plain(effect))


def statistic_name(statistic: str) -> str:
    """Return the name of a statistic of recordings and scenes, with its words in place of its key."""
    return STATISTICS.get(statistic, plain(statistic))


def form_name(form: str) -> str:
    """Return how a network predicts from several input frames, a key of FORMS, in words."""
    return FORMS.get(form, plain(form))


def plain(key: str) -> str:
    """Return a key as words."""
    return key.replace("_", " ")


def capitalised(text: str) -> str:
    """Return a sentence with a capital first letter; the others stay as they are."""
    return text[:1].upper() + text[1:]


def place_name(protocol: str, condition: str) -> str:
    """Return protocol and condition in words; of a protocol's one condition, the protocol alone says it."""
    named = condition == protocol or protocol.endswith(f"_{condition}")
    return capitalised(split_name(protocol) if named else f"{split_name(protocol)}, {task_name(condition)}")
