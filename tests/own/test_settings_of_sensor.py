"""Settings of a sensor mean the same in a block and by dotted keys, also for what follows from them."""

import re
from pathlib import Path

import pytest
import yaml
from builders.project import ROOT

from tactile import experiments
from tactile.base import params
from tactile.base.errors import InputError
from tactile.own import settings as own_settings

VALUES = params.load(ROOT / "params.yaml")
LISTS = ("protocols", "models")  # blocks that say what is run: whole, they are all of it
BLOCKS = [
    (experiment, name)
    for experiment in experiments.having("log")
    for name, block in VALUES[experiment].items()
    if isinstance(block, dict) and name not in LISTS
]
FURTHER = {  # values of a block that the settings lack, or that something follows from
    ("touch", "split"): {"train_on": ["exp1", "exp2"]},
    ("touch", "sensor"): {"order": list(range(25))[::-1]},
    ("strain", "sensor"): {"unit": "any", "tasks": {"press": ["x", "z"], "pull": ["y"]}, "pressed_below_mm": -2.5},
    ("strain", "split"): {"test_recordings": ["day2"]},
    ("strain", "window"): {"frames": 17},
    ("glove", "sensor"): {"scale": "range", "areas": {"cup": {"rows": 4, "cols": 5, "highest": 4095}}},
    ("glove", "window"): {"stride": 7},
}
SENSORS = {  # of one kind each, as dotted keys
    "presses": (
        "strain",
        {
            "strain.sensor.channels": 6,
            "strain.sensor.tasks": {"press": ["x", "y", "z"]},
            "strain.sensor.pressed_below_mm": -2.5,
            "strain.window.frames": 14,
        },
        {"strain": {"models": {"press_difference": {"trees": 50, "min_samples_leaf": 5, "press": 11}}}},
    ),
    "mat": (
        "glove",
        {"glove.sensor.reference_ohm": 470.0, "glove.sensor.areas": {"mat": {"rows": 4, "cols": 4}}},
        {"glove": {"protocols": {"session_mat": {"seeds": [0, 1]}}, "window": {"stride": 1}}},
    ),
    "array": (
        "touch",
        {"touch.sensor.rows": 4, "touch.sensor.cols": 3, "touch.sensor.pitch_mm": 8.0, "touch.sensor.element_mm": 6.0},
        {"touch": {"protocols": {"press": {"seeds": [0, 1]}}, "budget": 1.0}},
    ),
}


def written(folder: Path, experiment: str, given: dict, models=None) -> dict:
    """Return the settings of a sensor whose settings.yaml is `given`."""
    folder.mkdir(parents=True)
    (folder / own_settings.FILE).write_text(yaml.safe_dump(given, sort_keys=False))
    return params.read(own_settings.write(ROOT / "params.yaml", folder / "made", experiment, folder, [0, 1], models))


def in_blocks(dotted: dict, levels: int) -> dict:
    """Return dotted keys with their last `levels` parts as blocks."""
    found: dict = {}
    for key, value in dotted.items():
        *above, last = key.rsplit(".", levels)
        block = found.setdefault(above[0], {})
        for name in above[1:]:
            block = block.setdefault(name, {})
        block[last] = value
    return found


def holds(whole, part) -> bool:
    """Tell whether nested settings have all values of others."""
    return all(holds(whole[key], value) for key, value in part.items()) if isinstance(part, dict) else whole == part


@pytest.mark.parametrize(("experiment", "name"), BLOCKS)
def test_a_block_is_its_dotted_keys(experiment, name, tmp_path):
    block = VALUES[experiment][name] | FURTHER.get((experiment, name), {})
    dotted = {f"{experiment}.{name}.{key}": value for key, value in block.items()}
    of_dotted = written(tmp_path / "dotted", experiment, dotted)
    assert written(tmp_path / "block", experiment, {f"{experiment}.{name}": block}) == of_dotted
    mixed = dict(list(dotted.items())[::-1])
    assert written(tmp_path / "reversed", experiment, mixed) == of_dotted
    assert of_dotted[experiment][name] == block, "what the sensor says goes before what follows"


@pytest.mark.parametrize("sensor", SENSORS)
def test_what_follows_from_the_settings_of_a_sensor_hangs_on_no_spelling(sensor, tmp_path):
    experiment, dotted, expected = SENSORS[sensor]
    of_dotted = written(tmp_path / "dotted", experiment, dotted)
    assert holds(of_dotted, expected)
    of_block = written(tmp_path / "block", experiment, in_blocks(dotted, 1))
    usual = params.Params.model_validate  # a block without them has the usual values of keys that may be left out
    assert usual(of_block) == usual(of_dotted)


def test_a_whole_experiment_as_one_block_is_taken_as_it_is(tmp_path):
    block = VALUES["strain"] | {"budget": 0.5, "protocols": {"task_1": {"seeds": [4]}}}
    assert written(tmp_path / "it", "strain", {"strain": block})["strain"] == block


@pytest.mark.parametrize(
    ("experiment", "key", "value"),
    [
        ("touch", "touch.budget", VALUES["touch"]["budget"]),
        ("touch", "touch.protocols.press.seeds", [7]),
        ("strain", "strain.protocols.task_0.seeds", VALUES["strain"]["protocols"]["task_0"]["seeds"]),
        ("strain", "strain.models.window_trees.trees", 7),
        ("glove", "glove.protocols.session_pressure.seeds", [7]),
        ("glove", "glove.window.stride", VALUES["glove"]["window"]["stride"]),
    ],
)
def test_what_a_sensor_sets_is_not_set_again(experiment, key, value, tmp_path):
    made = written(tmp_path / "it", experiment, {key: value})
    for part in key.split("."):
        made = made[part]
    assert made == value


def test_a_model_that_a_look_leaves_out_may_have_settings(tmp_path):
    made = written(tmp_path / "it", "touch", {"touch.models.rbf.centres": 9}, ["constant", "linear"])
    assert list(made["touch"]["models"]) == ["constant", "linear"]
    made = written(tmp_path / "mat", "glove", SENSORS["mat"][1] | {"glove.models.sp_resnet.training.epochs": 3})
    assert "sp_resnet" not in made["glove"]["models"]


@pytest.mark.parametrize(
    ("experiment", "given", "lines"),
    [
        ("touch", {"touch.split": {"train_on": ["exp1"]}}, {"touch.split.train_on": ["exp1"]}),
        ("strain", {"strain.ingest": {"rate_hz": 14}}, {"strain.ingest.rate_hz": 14}),
        (
            "touch",
            {"touch.ingest": {"format": {"array.log": {"separator": ";"}}, "clock": "shared"}},
            {"touch.ingest.format": {"array.log": {"separator": ";"}}, "touch.ingest.clock": "shared"},
        ),
        ("touch", {"touch": {"sensor": {"rows": 4}, "budget": 0.5}}, {"touch.sensor.rows": 4, "touch.budget": 0.5}),
        ("glove", {"glove.models.tree": {"min_samples_leaf": 3}}, {"glove.models.tree.min_samples_leaf": 3}),
    ],
)
def test_part_of_a_block_is_refused_with_the_lines_that_work(experiment, given, lines, tmp_path):
    with pytest.raises(InputError) as error:
        written(tmp_path / "part", experiment, given)
    advised = dict(yaml.safe_load(line).popitem() for line in re.findall("`([^`]*: [^`]*)`", str(error.value)))
    assert advised == lines and "lacks '" in str(error.value)
    made = written(tmp_path / "whole", experiment, advised)
    for key, value in lines.items():
        block = made
        for part in key.split("."):
            block = block[part]
        assert block == value


def test_a_setting_in_both_spellings_at_once_is_refused(tmp_path):
    both = {"strain.sensor.channels": 5, "strain.sensor": {"channels": 6}}
    with pytest.raises(InputError, match="`strain.sensor.channels` is set twice, by `strain.sensor` and by"):
        written(tmp_path / "it", "strain", both)
    apart = {"touch.sensor.order": [1, 0], "touch.sensor": {"rows": 1, "cols": 2, "pitch_mm": 9.0, "element_mm": 8.0}}
    assert written(tmp_path / "apart", "touch", apart)["touch"]["sensor"]["order"] == [1, 0]


def test_a_target_may_be_asked_for_by_dotted_keys(tmp_path):
    target = {"name": "angle", "unit": "deg", "kind": "continuous", "file": "arm.log", "column": 2}
    split = {"by": "recording"}
    found = []
    for k, given in enumerate(
        (
            {"target": target, "split": split},
            {f"target.{key}": value for key, value in target.items()} | {"split.by": "recording"},
            {"target.column": 2, "target": {k: v for k, v in target.items() if k != "column"}, "split": split},
        )
    ):
        written(tmp_path / str(k), "strain", given)
        found.append(own_settings.asked(tmp_path / str(k)))
    assert found[0] is not None and found[1] == found[0] and found[2] == found[0]


FAULTS = {"dead": 0.1, "gain": 0.2, "offset": 0.02}


@pytest.mark.parametrize(
    ("experiment", "model"),
    [("touch", "lomp_stream"), ("touch", "cnn"), ("strain", "lstm_direct"), ("glove", "sp_resnet")],
)
def test_a_network_of_a_sensor_can_be_trained_with_faults(experiment, model, tmp_path):
    key = f"{experiment}.models.{model}.training"
    made = written(tmp_path / "it", experiment, {f"{key}.faults": FAULTS})[experiment]["models"]
    assert made[model]["training"] == VALUES[experiment]["models"][model]["training"] | {"faults": FAULTS}
    assert all("faults" not in block.get("training", {}) for name, block in made.items() if name != model)
    whole = {key: VALUES[experiment]["models"][model]["training"] | {"faults": FAULTS}}
    assert written(tmp_path / "block", experiment, whole)[experiment]["models"][model] == made[model]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"touch.models.linear.training.faults": FAULTS}, "`touch.models.linear.training.faults`: linear cannot be "
         "trained with faults; of the models of touch these can: cnn, vgg, convlstm, rnn, lomp, lomp_stream"),
        ({"touch.models.window_trees.training": {"faults": FAULTS}}, "window_trees cannot be trained with faults"),
        ({"strain.models.esn.training.faults": FAULTS}, "esn cannot .* lstm_direct, lstm_transfer, lstm_highpass"),
        ({"strain.models.lstm_transfer_ridge.training.faults": FAULTS}, "lstm_transfer_ridge cannot be trained with"),
        ({"glove.models.tree.faults": FAULTS}, "`glove.models.tree.faults`: tree cannot be trained with faults"),
        ({"touch.models.lomp.training.fault": FAULTS}, "did you mean 'faults'"),
        ({"touch.models.lomp.training.faults.dead": 0.1}, "there is no 'touch.models.lomp.training.faults' in which "
         "'dead' could be set; write all of it, `touch.models.lomp.training.faults: {dead: ..., gain: ..., offset"),
        ({"touch.models.lomp.training.faults": FAULTS | {"ded": 0.1}}, "unknown key 'ded'; did you mean 'dead'"),
        ({"touch.models.lomp.training.faults": {"dead": 0.1, "gain": 0.2}}, "key 'offset' is missing"),
        ({"touch.models.lomp.training.faults": FAULTS | {"dead": 1.5}}, "faults.dead: .* or equal to 1, got 1.5"),
        ({"touch.models.lomp.training.faults": FAULTS | {"gain": -0.2}}, "faults.gain: .* or equal to 0"),
        ({"touch.models.lomp.training.faults": dict.fromkeys(FAULTS, 0.0)}, "dead, gain and offset are all 0"),
    ],
)  # fmt: skip
def test_faults_that_cannot_be_are_refused_with_the_key(given, words, tmp_path):
    experiment = next(iter(given)).partition(".")[0]
    with pytest.raises(InputError, match="settings.yaml.*" + words):
        written(tmp_path / "it", experiment, given)
