"""The evidence: every set is valid and has its stages; a shard comes out the same twice and says what it is of."""

import shutil

import pandas as pd
import pytest
import yaml
from builders import kept_scores
from builders.project import ROOT, in_this_process, miniature_settings

from pipeline.results import kept, shards, studies
from pipeline.results.shards import Shard
from pipeline.stages import shard
from tactile.base import files, params
from tactile.base.errors import InputError
from tactile.base.params_file import copied
from tactile.base.paths import Workspace
from tactile.settings.shards import Variant

LATENT = ("drift", "latents")
SETS = shards.read_sets(Workspace(ROOT))


def test_every_shard_has_its_stage():
    stages = yaml.safe_load((ROOT / "evidence" / "dvc.yaml").read_text())["stages"]
    assert list(stages) == list(SETS)
    for name, each in SETS.items():
        matrix = stages[name]["matrix"]
        assert matrix == {"seed": list(range(each.seeds)), "budget": list(shards.budgets(each))}, name
        assert {"set": name} in stages[name]["vars"] and {"experiment": each.experiment} in stages[name]["vars"]


def test_the_index_has_the_digest_of_every_shard_as_it_is_kept():
    """No file of an older computation has come back, not even where the lock of DVC was renewed after it."""
    here = shards.folder(Workspace(ROOT))
    for line in pd.read_csv(here / "index.csv").itertuples():
        each = SETS[line.shard.rsplit("-", 2)[0]]
        tables = LATENT if each.study == "latent" else [each.study]
        results = [shards.study_file(Workspace(ROOT), each.experiment, table, line.seed) for table in tables]
        results = results if each.study else [here / "results" / f"{line.shard}.csv"]
        assert shards.digest(results) == line.sha256, line.shard
        assert shards.kept_sha256(Workspace(ROOT), line.shard) == (
            "" if pd.isna(line.kept_sha256) else line.kept_sha256
        )


@pytest.mark.parametrize("name", SETS)
def test_a_set_is_of_settings_that_there_are(name, tmp_path):
    each = SETS[name]
    values = shard.settings_of(Workspace(ROOT), each, Workspace(tmp_path), {})
    assert list(values[each.experiment]["protocols"]) == each.protocols
    assert set(each.by_unit) <= set(each.protocols)
    simulated = values[each.experiment].get("simulate")
    assert simulated is None or simulated["specimens"] >= each.seeds  # each seed has a specimen of its own


def test_sets_that_share_data_ask_for_the_same():
    stages = yaml.safe_load((ROOT / "evidence" / "dvc.yaml").read_text())["stages"]
    for name, each in SETS.items():
        if each.like and not (each.study or each.variants):
            other = SETS[each.like]
            assert stages[name]["params"][-1] == {"evidence/shards.yaml": [each.like, name]}
            assert (each.experiment, other.like) == (other.experiment, ""), name
            differing = {key for key in each.set if each.set[key] != other.set.get(key)}
            assert all(".models." in key for key in differing) and bool(differing) == (each.variant != other.variant), (
                name
            )


def test_a_study_trains_only_the_models_that_it_names():
    """Those of the set whose data it shares are no models of the study."""
    assert SETS["glove_session"].models and SETS["input_frames_glove"].models == []
    assert SETS["strain"].models == [] and SETS["latent_strain"].models == ["lstm_direct"]


def test_a_budget_is_a_share_of_the_epochs():
    block = {"units": 50, "training": {"learning_rate": 0.1, "epochs": 15, "drop_epoch": 8}}
    assert params.at_budget(block, shard.SHARES["full"]) == block
    half = params.at_budget(block, shard.SHARES["half"])
    assert half == {"units": 50, "training": {"learning_rate": 0.1, "epochs": 8, "drop_epoch": 4}}
    assert params.at_budget(block, 0.01)["training"]["epochs"] == 1
    assert params.at_budget({"ridge": 1.0}, 0.5) == {"ridge": 1.0}
    values = {"strain": {"budget": 0.2, "models": {"lstm": block}, "protocols": {"a": {"passes": 2}, "b": {}}}}
    epochs = [params.run_settings(values, "strain", "lstm", name)["training"]["epochs"] for name in "ab"]
    assert epochs == [6, 3]


@pytest.fixture(scope="module")
def strain(tmp_path_factory):
    """A checkout in miniature with one shard computed, and the call that computes it again."""
    workspace = Workspace(tmp_path_factory.mktemp("checkout"))
    miniature_settings(workspace)
    each = SETS["strain"].model_copy(update={"seeds": 1, "set": {}})

    def compute():
        shard.compute(workspace, Shard("strain", 0, "half"), {"strain": each})

    with pytest.MonkeyPatch.context() as patch:
        in_this_process(patch)
        compute()
        yield workspace, compute


@pytest.mark.slow
def test_a_shard_says_what_it_is_of_and_comes_out_the_same(strain):
    workspace, compute = strain
    folder = shards.folder(workspace)
    result = folder / "results" / "strain-0-half.csv"
    first = result.read_bytes()
    table = shards.read(workspace)
    timed = table["metric"] == "train_s"  # from times.csv, of all models
    assert set(table[timed]["model"]) == set(table[~timed & (table["model"] != "data")]["model"])
    table = table[~timed]
    trained = set(table[table["budget"] == "half"]["model"])
    assert {"lstm_direct", "lstm_transfer", "lstm_transfer_ridge"} <= trained and "ridge" not in trained
    table = table[table["model"] != "data"]  # of all recordings, the same in every shard
    assert set(table["seed"]) == {0} and not table.duplicated(["protocol", "condition", "model", "metric"]).any()
    assert {"error", "r2", "params"} <= set(table["metric"]) and "train_s" not in result.read_text()
    (line,) = pd.read_csv(folder / "index.csv").to_dict("records")
    assert (line["shard"], line["experiment"], line["budget"]) == ("strain-0-half", "strain", "half")
    assert line["sha256"] == files.sha256(result) and line["core_s"] > 0 and line["machine"]
    drawn = shards.kept_file(workspace, "strain-0-half")
    assert line["kept_sha256"] == files.sha256(drawn) and drawn.stat().st_size < kept.LARGEST
    found = kept_scores.of("strain", kept.read(drawn, "strain"))
    both = found.merge(table.assign(budget=""), on=kept_scores.KEY, suffixes=("", "_of_row"))
    assert len(both) == len(found) == 2 * len(set(table["model"]))  # tasks 1 and 2
    assert both["value"].to_list() == pytest.approx(both["value_of_row"].to_list(), rel=1e-9)
    times = pd.read_csv(folder / "times.csv")
    assert (times["train_s"] >= 0).all() and set(times["model"]) == set(table["model"])
    assert not (workspace.root / "build" / "evidence" / "strain-0-half").exists()
    result.unlink()
    compute()
    assert result.read_bytes() == first and len(pd.read_csv(folder / "index.csv")) == 1


@pytest.mark.slow
def test_a_shard_keeps_what_its_models_score_under_stress(strain, tmp_path):
    """Only at the full budget; severity 0 is the score of the results, and every severity of the settings is there."""
    half, _ = strain
    assert SETS["strain"].stress and not SETS["glove_augmentation_A"].stress  # which is like a set that has it
    assert shards.stress(half).empty
    workspace = Workspace(tmp_path)
    copied(half.params, workspace.root)
    shutil.copytree(half.root / "build", workspace.root / "build", symlinks=True)
    each = SETS["strain"].model_copy(update={"seeds": 1, "set": {}})
    shard.compute(workspace, Shard("strain", 0, "full"), {"strain": each})
    table, results = shards.stress(workspace), shards.read(workspace)
    place = ["protocol", "condition", "model", "variant", "seed", "budget", "metric"]
    assert set(table["metric"]) == {"error"} and set(table["protocol"]) == {"task_1", "task_2"}
    readings = table[~table["perturbation"].isin(["rate", "speed", "specimen"])]  # these have a recording of their own
    clean = readings[readings["severity"] == 0].merge(results.fillna({"budget": "", "variant": ""}), on=place)
    assert len(clean) == (readings["severity"] == 0).sum() > 0
    assert clean["value_x"].to_numpy() == pytest.approx(clean["value_y"].to_numpy(), rel=1e-4)
    asked = params.load(workspace.params)["stress"]["strain"]["perturbations"]
    found = {name: set(rows["severity"]) for name, rows in table.groupby("perturbation")}
    assert found == {name: {0, *severities} for name, severities in asked.items()}
    assert set(table[table["model"] == "lstm_direct"]["budget"]) == {"full"}


@pytest.mark.slow
def test_a_study_keeps_its_tables_and_comes_out_the_same(strain, tmp_path):
    checkout, _ = strain
    workspace = Workspace(tmp_path)
    copied(checkout.params, workspace.root)
    shutil.copytree(checkout.root / "build", workspace.root / "build", symlinks=True)
    few = {"seeds": 1, "set": {}}
    sets = {name: SETS[name].model_copy(update=few) for name in ("strain", "latent_strain")}
    tables = []
    for _ in range(2):
        shard.compute(workspace, Shard("latent_strain", 0, "full"), sets)
        kept = sorted((shards.folder(workspace) / "studies" / "strain").glob("*.csv"))
        assert [path.name for path in kept] == [f"{name}-0.csv" for name in LATENT]
        tables.append([path.read_bytes() for path in kept])
    assert tables[0] == tables[1]
    (line,) = pd.read_csv(shards.folder(workspace) / "index.csv").to_dict("records")
    assert (line["shard"], line["protocol"], line["seed"]) == ("latent_strain-0-full", "study", 0)
    assert shards.read(workspace).empty  # its tables are no rows of the one table
    drift = studies.read(workspace, "strain", "drift", ["target", "value"])
    assert "true drift" in set(drift["target"]) and drift["value"].notna().all()


@pytest.mark.slow
def test_variants_are_rows_of_the_one_table_and_come_out_the_same(strain, tmp_path):
    """On the data and from the network of the set that theirs is like; the rows are those of the module alone."""
    checkout, _ = strain
    workspace = Workspace(tmp_path)
    copied(checkout.params, workspace.root)
    shutil.copytree(checkout.root / "build", workspace.root / "build", symlinks=True)
    units, transfer = {"strain.models.lstm_direct.units": 3}, ["lstm_direct", "lstm_transfer"]
    small = {
        "units_3": Variant(models=["lstm_direct"], protocols=["task_1"], set=units),
        "strands_2": Variant(models=transfer, set={"strain.sensor.channels": 2}),
    }
    few = {"seeds": 1, "set": {}}
    sets = {"strain": SETS["strain"].model_copy(update=few)}
    sets["variants_strain"] = SETS["variants_strain"].model_copy(update=few | {"variants": small})
    result, made = shards.result_file(workspace, "variants_strain-0-full"), []
    for _ in range(2):
        shard.compute(workspace, Shard("variants_strain", 0, "full"), sets)
        made.append(result.read_bytes())
    assert made[0] == made[1]
    (line,) = pd.read_csv(shards.folder(workspace) / "index.csv").to_dict("records")
    assert (line["protocol"], line["sha256"]) == ("task_1+task_2+task_0", files.sha256(result))
    assert not (shards.folder(workspace) / "studies").exists() and not (shards.folder(workspace) / "times.csv").exists()
    rows = shards.read(workspace)
    scored = rows[rows["metric"] == "error"]
    assert set(zip(scored["variant"], scored["model"], scored["protocol"], strict=True)) == {
        ("units_3", "lstm_direct", "task_1"),
        *(("strands_2", model, f"task_{k}") for model in transfer for k in range(3)),
    }
    assert len(scored) == 7 and (scored["value"] > 0).all() and set(rows["seed"]) == {0} and rows["budget"].isna().all()
    costs = rows[(rows["metric"] == "params") & (rows["protocol"] == "task_1")].set_index(["variant", "model"])["value"]
    assert costs["units_3", "lstm_direct"] == 4 * 3 * (6 + 3 + 1) + 3  # gates of three units, read-out


@pytest.mark.parametrize("model", ["rnn", shards.DATA])
def test_last_digits_of_another_machine_make_no_second_result_nor_does_a_set_that_has_grown(tmp_path, model):
    workspace, columns = Workspace(tmp_path), shards.COLUMNS
    of_data = ("touch", "press", "single", model, "", "shift", 0, "", "counts")
    first, last_digits, other = 94.88475396520789, 94.88475396520786, 94.9
    of_grown = [other] if model == shards.DATA else [first, other]
    for numbers, known in (((first, last_digits), [pytest.approx(first)]), ((first, other), of_grown)):
        for seed, value in enumerate(numbers):
            path = shards.folder(workspace) / "results" / f"a-{seed}-full.csv"
            files.write_table(path, pd.DataFrame([(*of_data, value, 1)], columns=columns))
            line = dict.fromkeys(shards.INDEX, "") | {"shard": f"a-{seed}-full", "sha256": files.sha256(path)}
            shards.upsert(shards.folder(workspace) / "index.csv", shards.INDEX, line["shard"], [line | {"seed": seed}])
        assert shards.read(workspace)["value"].tolist() == known  # two that differ are refused where they are used


@pytest.mark.parametrize("budgets", [("half", "full"), ("half",)])
def test_what_no_epochs_change_is_that_of_the_full_shard_of_a_seed(tmp_path, budgets):
    """Another machine had other digits from the fifth on; where there is no such shard, half of it is what is known."""
    workspace = Workspace(tmp_path)
    for budget, linear in zip(budgets, (9.3526, 9.3563), strict=False):
        rows = [
            ("touch", "press", "single", "linear", "", "rmse", 0, "", "kPa", linear, 1),
            ("touch", "press", "single", "cnn", "", "rmse", 0, budget, "kPa", 5.0, 1),
        ]
        path = shards.result_file(workspace, f"a-0-{budget}")
        files.write_table(path, pd.DataFrame(rows, columns=shards.COLUMNS))
        line = dict.fromkeys(shards.INDEX, "") | {"shard": f"a-0-{budget}", "sha256": files.sha256(path)}
        line |= {"seed": 0, "budget": budget}
        shards.upsert(shards.folder(workspace) / "index.csv", shards.INDEX, line["shard"], [line])
    table = shards.read(workspace)
    assert table[table["model"] == "linear"]["value"].tolist() == [9.3563 if "full" in budgets else 9.3526]
    assert set(table[table["model"] == "cnn"]["budget"]) == set(budgets)


@pytest.mark.slow
def test_a_result_that_the_index_does_not_know_is_refused(strain, tmp_path):
    workspace, _ = strain
    copy = Workspace(tmp_path)
    shutil.copytree(shards.folder(workspace), shards.folder(copy))
    with open(shards.folder(copy) / "results" / "strain-0-half.csv", "a") as file:
        file.write("strain,task_1,task_1,ridge,,error,0,,mm,0.0,1\n")
    with pytest.raises(InputError, match="strain-0-half.csv: not the file that .*index.csv tells of"):
        shards.read(copy)


def test_a_wrong_key_of_a_set_names_its_file(tmp_path):
    workspace = Workspace(tmp_path)
    files.write_text(shards.folder(workspace) / "shards.yaml", "strain: {experiment: strain, protocol: [task_1]}\n")
    with pytest.raises(InputError, match="evidence/shards.yaml, strain: unknown key 'protocol'; did you mean"):
        shards.read_sets(workspace)
