"""Variants: what they are trained on and with, what transfer starts from, and what is refused."""

import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from builders.noted_series import noting
from builders.project import ROOT, run_stage

from pipeline.results import shards
from pipeline.studies import variants
from tactile import models
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.params_file import copied, set_values
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.experiments import strain
from tactile.scoring import metrics
from tactile.settings.shards import Variant

SETS = {name: each for name, each in shards.read_sets(Workspace(ROOT)).items() if each.variants}
FRAMES, ELEMENTS, CELLS = 8, 25, 400
STREAMS = "strain.models.lstm_direct.training.streams"


@pytest.fixture
def varied(workspace):
    """The settings of the tables in the workspace, one seed and all epochs, and the call of one variant."""
    copied(ROOT / "params.yaml", workspace.root)
    set_values({"device": "cpu"}, workspace.params)
    seeds = {f"strain.protocols.task_{k}.seeds": [0] for k in range(3)}
    set_values(seeds | {"strain.budget": 1.0, "touch.budget": 1.0}, workspace.params)

    def run(experiment, **given) -> pd.DataFrame:
        variant = Variant(**given)
        known = params.load(workspace.params)
        return pd.DataFrame(variants.run(workspace, known, experiment, "one", variant, 0, lambda: None))

    return run


@pytest.mark.parametrize("name", SETS)
def test_the_committed_variants_can_be_trained_and_differ_in_one_thing(name):
    each = SETS[name]
    tables, seen = params.load(ROOT / "params.yaml"), []
    for variant in each.variants.values():
        values = variants.varied(Workspace(ROOT), each.experiment, variant)
        block = values[each.experiment]
        assert set(variant.models) <= set(block["models"]) and set(variant.protocols) <= set(each.protocols)
        seen.append([variant.models, json.dumps(block, sort_keys=True)])
        others = {
            key for key in variant.set if variant.like and variant.set[key] != each.variants[variant.like].set.get(key)
        }
        assert len({key.rpartition(".")[2] for key in others}) <= 1
        for key in ("simulate", "label", "split"):
            assert block.get(key) == tables[each.experiment].get(key), "the data are those of the set"
    twice = [one for one in seen if seen.count(one) > 1]
    assert all(one[0] == ["lomp"] for one in twice), "but for lomp_half, which is a rung of the ladder, too"


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"touch.models.lomp.alfa": 0.0}, "evidence/shards.yaml: there is no key .*did you mean 'alpha'"),
        ({"touch.models.lompp.alpha": 0.0}, "evidence/shards.yaml: there is no key .*did you mean 'lomp'"),
        ({"touch.models.lomp.alpha": "none"}, "evidence/shards.yaml, touch.models.lomp.alpha: "),
        ({"glove.models.sp_resnet.width": 0.3}, "evidence/shards.yaml, glove.models.sp_resnet.width: .*multiple"),
        ({"strain.protocols.task_1.samples": 1}, "evidence/shards.yaml, strain.protocols.task_1.samples: "),
        ({"strain.protocols.task_1.base": "task_9"}, "evidence/shards.yaml, strain.protocols.task_1.base: "),
    ],
)
def test_a_variant_that_cannot_be_trained_is_one_sentence(varied, wrong, words):
    with pytest.raises(InputError, match=words):
        varied(next(iter(wrong)).partition(".")[0], models=["lomp"], protocols=["press"], set=wrong)


@pytest.mark.parametrize(
    "name",
    [
        "touch.simulate.seed",
        "touch.window.stride",
        "touch.sensor.rows",
        "touch.split.seed",
        "touch.protocols.press.seeds",
    ]
    + ["touch.budget", "touch.protocols", "touch.windowXframes", "glove.models.sp_resnet.width", "device"],
)
def test_what_would_change_nothing_or_the_data_is_refused(varied, name):
    with pytest.raises(InputError, match=f"evidence/shards.yaml: a variant of touch cannot change '{name}'"):
        varied("touch", models=["lomp"], protocols=["press"], set={"touch.models.lomp.alpha": 0.0, name: 1})


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("{a: {models: [x]}, b: {like: c}}", "shards.yaml, one.variants.'b': there is none to be like: known: a, b"),
        ("{a: {like: aa}, ab: {models: [x]}}", "one.variants.'a': there is none to be like: did you mean 'a"),
        ("{a: {model: [x]}}", "one.variants.a: unknown key 'model'; did you mean 'models'"),
        ("{a: {set: {}}}", "one.variants.a: key 'models' is missing"),
        ("{a: {models: [x], set: [1]}}", "one.variants.'a': expected a block, in which `set` is a block"),
        ("[a]", "one.variants: expected a block for each name"),
    ],
)
def test_a_wrong_entry_is_one_sentence(workspace, block, words):
    file = shards.folder(workspace) / "shards.yaml"
    file.parent.mkdir()
    file.write_text(
        f"one: {{experiment: touch, data: a, protocols: [press], seeds: 1, minutes: 1, variants: {block}}}\n"
    )
    with pytest.raises(InputError, match=words):
        shards.read_sets(workspace)


def windows(path, seeds=(0,)) -> np.ndarray:
    """Write windows whose labels follow the frame before the last: the last alone cannot tell them; return parts."""
    rng = np.random.default_rng(0)
    part = np.repeat(["train", "validation", "test", "unused"], [120, 20, 40, 20])
    x = rng.integers(0, 1000, (200, FRAMES, ELEMENTS)).astype(np.int16)
    y = np.repeat(x[:, -2, :1] / 5.0, CELLS, axis=1) + np.arange(CELLS) % 7
    table = pa.table(
        {
            "condition": pa.array(["single", "double"] * 100).dictionary_encode().cast(schemas.NAME),
            "previous": pa.array(np.full(200, -1, np.int32)),
            "force_n": schemas.lists(np.ones((200, 1), np.float32), pa.float32()),
            **{
                schemas.split_column("press", seed): pa.array(part).dictionary_encode().cast(schemas.NAME)
                for seed in seeds
            },
            "x": schemas.lists(x.reshape(200, -1), pa.int16()),
            "y": schemas.lists(y.astype(np.float32), pa.float32()),
        }
    )
    schemas.write(path, table.schema, [table])
    return x


def test_a_variant_sees_its_last_frames_and_is_scored_on_the_test_part(workspace, varied, monkeypatch):
    windows(workspace.dataset("touch"))
    monkeypatch.setattr(metrics, "force_gain", lambda *given: 1.0)
    monkeypatch.setattr(metrics, "force", lambda *given: [])
    errors = {}
    for frames in (1, 2):
        tree = {"touch.models.tree.each": "input", "touch.window.frames": frames}
        rows = varied("touch", models=["tree"], protocols=["press"], set=tree)
        scored = rows[rows["metric"] == "rmse"]
        assert set(scored["condition"]) >= {"single", "double"}
        assert (scored[scored["condition"].isin(["single", "double"])]["n"] == 20).all()
        errors[frames] = scored["value"].mean()
    assert errors[2] < errors[1] / 5
    with pytest.raises(InputError, match=r"its windows have 8 frames, and the setting window.frames asks for 9"):
        varied("touch", models=["tree"], protocols=["press"], set={"touch.window.frames": 9})


def test_rows_are_those_of_the_one_table(workspace, varied, monkeypatch):
    """Of the shard's file they are read as the table has them, costs of a model under `any`."""
    windows(workspace.dataset("touch"), seeds=(4,))
    monkeypatch.setattr(metrics, "touch", lambda *given: [("rmse", "kPa", 1.5, 20)])
    monkeypatch.setattr(metrics, "force_gain", lambda *given: 1.0)
    monkeypatch.setattr(metrics, "force", lambda *given: [])
    sets = {"one": SETS["variants_touch"].model_dump(exclude={"like"}, exclude_defaults=True)}
    sets["one"]["variants"] = {"few": {"models": ["linear"]}}
    shards.folder(workspace).mkdir()
    (shards.folder(workspace) / "shards.yaml").write_text(json.dumps(sets))
    run_stage(monkeypatch, workspace, variants, "touch", "4")
    table = pd.read_csv(workspace.study_result("touch", "variants"))
    assert list(table.columns) == shards.COLUMNS and table["budget"].isna().all()
    named = table[["model", "variant", "protocol", "seed"]].drop_duplicates()
    assert named.values.tolist() == [["linear", "few", "press", 4]]
    assert set(table[table["metric"] == "rmse"]["condition"]) >= {"single", "double"}
    costs = table[table["condition"] == "any"].set_index("metric")["value"]
    assert set(costs.index) == {"params", "macs"} and (costs > 0).all()


@pytest.fixture
def unscored(monkeypatch):
    """The recording is of one output: of tasks of two, no score is of interest."""
    monkeypatch.setattr(metrics, "series", lambda *given: [("error", "mm", 1.0, 20)])


@pytest.fixture
def series(monkeypatch):
    """What is built in place of every network of series, its recording, and what it was built with."""
    model = noting(monkeypatch)
    model.built, model.macs = [], lambda: 9
    monkeypatch.setattr(models, "build", lambda name, spec, block, where: model.built.append((name, block)) or model)
    return model


def test_few_samples_are_the_last_ones_before_the_test_part(varied, series):
    rows = varied("strain", models=["lstm_direct"], protocols=["task_1"], set={"strain.protocols.task_1.samples": 30})
    ((x, y, counted, training, press),) = series.records
    expected = series.piece.record
    assert np.array_equal(x, expected.x[50:80]) and np.array_equal(y, expected.y[50:80])
    assert training.all() and counted.all() and len(training) == len(counted) == len(press) == 30
    assert rows[rows["metric"] == "error"]["value"].tolist() == [pytest.approx(3.0)]


def test_all_samples_end_before_the_test_part_and_keep_their_validation(varied, series):
    varied("strain", models=["lstm_direct"], protocols=["task_1"])
    ((x, _, _, training, _),) = series.records
    assert np.array_equal(x, series.piece.record.x[:80]) and training.tolist() == [True] * 70 + [False] * 10


@pytest.mark.parametrize(
    ("changed", "base"),
    [
        ({}, "task_0"),
        ({"strain.protocols.task_2.base": "task_1"}, "task_1"),
        ({"strain.protocols.task_2.samples": 30}, "task_0"),  # of task 2, not of what transfer starts from
        ({"strain.models.lstm_transfer.training.epochs": 3}, "task_0"),
        ({"strain.models.ridge.ridge": 3.0}, "task_0"),
    ],
)
def test_transfer_starts_from_the_network_of_the_tables(workspace, varied, series, unscored, changed, base):
    varied("strain", models=["lstm_transfer", "lstm_transfer_ridge"], protocols=["task_2"], set=changed)
    assert [name for name, _ in series.built] == ["lstm_transfer", "lstm_transfer_ridge"]
    assert series.bases == 2 * [workspace.run_folder("strain", "lstm_direct", base, 0)]


@pytest.mark.parametrize(
    "changed",
    [
        {"strain.sensor.channels": 2},
        {"strain.models.lstm_direct.units": 3},
        {STREAMS: 4},
        {"strain.window.frames": 4},
        {"strain.protocols.task_0.samples": 30},
    ],
)
def test_a_first_network_that_sees_other_things_or_is_trained_otherwise_is_the_variants_own(
    workspace, varied, series, unscored, changed
):
    """It is trained once for all that starts from it."""
    varied("strain", models=["lstm_direct", "lstm_transfer"], protocols=["task_1", "task_2"], set=changed)
    assert [name for name, _ in series.built] == ["lstm_direct", "lstm_direct", "lstm_transfer"] + [
        *("lstm_direct", "lstm_transfer")
    ]
    (zero,) = series.saved
    assert series.bases == [None, None, zero, None, zero] and workspace.root not in zero.parents
    blocks = [block for name, block in series.built if name == "lstm_direct"]
    assert all(block == blocks[0] for block in blocks)


def test_more_strands_than_there_are_is_one_sentence(workspace, varied):
    table = pa.table(
        {
            **{name: pa.array(["a"] * 3).dictionary_encode() for name in ("condition", "recording")},
            "t_s": np.arange(3.0),
            "press": pa.array([0] * 3, pa.int32()),
            "v": schemas.lists(np.zeros((3, 6)), pa.float32()),
            "y": schemas.lists(np.zeros((3, 3)), pa.float32()),
            schemas.split_column("task_1", 0): pa.array(["train"] * 3).dictionary_encode(),
        }
    )
    schemas.write(workspace.dataset("strain"), table.schema, [table])
    with pytest.raises(InputError, match="dataset.parquet: its samples have 6 channels, and the settings ask for 8"):
        varied("strain", models=["lstm_direct"], protocols=["task_1"], set={"strain.sensor.channels": 8})


def test_fewer_strands_are_the_first_ones(workspace, varied, series, monkeypatch):
    seen, task = [], strain.task

    def noted(protocol, settings):
        seen.append(task(protocol, settings).channels[protocol])
        return task(protocol, settings)

    monkeypatch.setattr(strain, "task", noted)
    varied("strain", models=["lstm_direct", "lstm_transfer"], protocols=["task_1"], set={"strain.sensor.channels": 2})
    assert seen and all(channels == [0, 1] for channels in seen)
