"""`tactile predict` scores a model on logs that it has not seen, and says of all others why it does not."""

import bz2
import gzip
import json
import shutil
import weakref
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from builders import free_targets, live_models, own_logs
from builders.project import ROOT

from tactile.base import arguments, files, params
from tactile.base import cards as base_cards
from tactile.commands import targets
from tactile.commands.targets import Effort
from tactile.datasets import schemas
from tactile.inference import card as cards
from tactile.inference import consistent, predictor, recordings
from tactile.targets import kept

TOUCH = params.load(ROOT / "params.yaml")["touch"]
SENSOR = {"rows": 2, "cols": 3, "pitch_mm": 10.0, "element_mm": 9.0, "order": []}
READING = {"sensor": SENSOR, "ingest": TOUCH["ingest"] | {"max_reject_fraction": 0.1}}
READING["ingest"] |= {"format": {"array.log": {"separator": ","}}}  # else no packed log is read
READING |= {"window": TOUCH["window"] | {"frames": 3, "frame_step": 2}}
READING |= {"label": TOUCH["label"] | {"map_rows": 8, "map_cols": 12}}
OF_TEST = [("double", "rmse", "kPa", 9.0), ("single", "rmse", "kPa", 11.29), ("single", "force_gain", "1", 2.0)]
OF_TEST += [("single", "r2", "1", 0.44)]


def answer(out: Path) -> dict[str, dict]:
    """Return the summaries of summary.json by recording, which is JSON without NaN."""

    def refused(word: str):
        raise AssertionError(f"{word} is no JSON")

    text = (out / "summary.json").read_text()
    return {each["recording"]: each for each in json.loads(text, parse_constant=refused)["recordings"]}


def logged(folder: Path, part: list[str], name: str = "single/day1_0") -> cards.Log:
    """Return what a card keeps of a log in a folder."""
    (log,) = (path for path in folder.iterdir() if path.name in ("array.log", "daq.log", "scanner.log"))
    return cards.Log(name=name, sha256=files.content_sha256(log), parts=part)


@pytest.fixture(scope="module")
def array(tmp_path_factory) -> Path:
    """Return the folder of two recordings of an array, single/day1_0 and day1_1."""
    folder = tmp_path_factory.mktemp("array")
    own_logs.touch(folder, 2, 3, 50.0, seconds=30.0, conditions=())
    return folder / "single"


def described(folder: Path, **changed) -> Path:
    """Change the card of a package."""
    cards.write(folder, consistent.read(folder).model_copy(update=changed))
    return folder


@pytest.fixture(scope="module")
def linear(tmp_path_factory, array) -> Path:
    """Return a package of the array that was trained on day1_0."""
    folder = live_models.linear(tmp_path_factory.mktemp("models") / "linear")
    scores = [cards.Score(condition=a, metric=b, unit=c, value=d, n=50) for a, b, c, d in OF_TEST]
    known = [logged(array / "day1_0", ["train", "validation", "test"])]
    return described(folder, reading=READING, scores=scores, logs=known)


def repacked(source: Path, target: Path, how: str) -> None:
    """Copy a recording, its sensor's log written in another way or under another name."""
    shutil.copytree(source, target)
    log = next(path for path in target.iterdir() if path.name in ("array.log", "daq.log", "scanner.log"))
    content = log.read_bytes()
    lines = content.replace(b"\r\n", b"\n")
    log.write_bytes(
        {
            "plain": content,
            "gzip": gzip.compress(content),
            "LF": lines,
            "CR LF": lines.replace(b"\n", b"\r\n"),
            "mark": b"\xef\xbb\xbf" + content,
            "no end": content.rstrip(b"\r\n"),
        }[how]
    )


@pytest.mark.parametrize("how", ["plain", "gzip", "LF", "CR LF", "mark", "no end"])
def test_a_copy_of_a_log_is_that_log(how, array, tmp_path):
    repacked(array / "day1_0", tmp_path / "copy", how)
    log, copy = (files.content_sha256(folder / "array.log") for folder in (array / "day1_0", tmp_path / "copy"))
    assert log == copy != files.content_sha256(array / "day1_1" / "array.log")
    text = (tmp_path / "copy" / "array.log").read_bytes()
    if how != "gzip":
        (tmp_path / "packed").write_bytes(bz2.compress(text))
        assert files.content_sha256(tmp_path / "packed") == log
        (tmp_path / "changed").write_bytes(text.replace(b"7", b"8", 1))
        assert files.content_sha256(tmp_path / "changed") != log


def test_a_log_larger_than_a_block_is_read_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "BLOCK", 7)
    (tmp_path / "a").write_bytes(b"1,2\r\n3,4\r\n5,6\r\n")
    (tmp_path / "b").write_bytes(b"1,2\n3,4\n5,6")
    assert files.content_sha256(tmp_path / "a") == files.content_sha256(tmp_path / "b")
    monkeypatch.undo()
    assert files.content_sha256(tmp_path / "a") == files.content_sha256(tmp_path / "b")


def test_only_logs_that_did_not_train_are_scored(linear, array, called, tmp_path, monkeypatch):
    given = {}
    for how in ("plain", "gzip", "LF", "no end"):
        repacked(array / "day1_0", tmp_path / "logs" / f"my {how}", how)
    shutil.copytree(array / "day1_1", tmp_path / "logs" / "new")
    said = called("predict", linear, tmp_path / "logs", "--out", tmp_path / "out", "--no-pictures")
    found = answer(tmp_path / "out")
    new = found.pop("new")
    expected = recordings.scores(predictor.load(linear), array / "day1_1" / "array.log")
    assert new["scores"]["rmse (kPa)"] == pytest.approx(expected[0][2]) and "not_scored" not in new
    assert new["scores"] == recordings.named(expected, consistent.read(linear)) and "held_out" not in new
    assert len(found) == 4
    for each in found.values():
        assert each["scores"] is None and each["not_scored"] == "trained on this recording: no test"
        assert each["held_out"] == {"rmse (kPa)": 11.29, "r2": 0.44}
    (line,) = (line for line in said.splitlines() if line.startswith("my gzip: "))
    quoted = "no test; held out (test part of `press`, seed 0): rmse (kPa) 11.3, r2 0.44"
    assert line.endswith(f"trained on this recording: {quoted}")
    assert said.count("rmse (kPa)") == 5 and "warning" not in json.loads((tmp_path / "out/summary.json").read_text())
    # A single log, and an answer in JSON.
    monkeypatch.setattr(arguments, "answer", lambda _, result: given.update(result))
    called("predict", linear, tmp_path / "logs" / "my LF" / "array.log", "--out", tmp_path / "out", "--json")
    (one,) = given["recordings"]
    assert one["scores"] is None and one["held_out"]["r2"] == 0.44 and given["not_scored"] == []


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        (["test"], None),
        (["validation"], "this recording is of the validation part: no test"),
        (["validation", "test"], "this recording is of the validation part: no test"),
        (["train", "test"], "trained on this recording: no test"),
    ],
)
def test_a_recording_that_a_split_held_out_is_scored(parts, reason, linear, array, called, tmp_path):
    model = shutil.copytree(linear, tmp_path / "model")
    described(model, logs=[logged(array / "day1_1", ["train"], "a"), logged(array / "day1_0", parts, "b")])
    said = called("predict", model, array / "day1_0", "--out", tmp_path / "out", "--no-pictures")
    (one,) = answer(tmp_path / "out").values()
    assert one.get("not_scored") == reason and (one["scores"] is None) == (reason is not None)
    assert ("; held out (test part of `press`, seed 0)\n" in said) == (reason is None)
    # The same log twice in the split, once in training: it has been seen.
    described(model, logs=[logged(array / "day1_0", ["test"], "b"), logged(array / "day1_0", ["train"], "c")])
    called("predict", model, array / "day1_0", "--out", tmp_path / "out", "--no-pictures")
    assert answer(tmp_path / "out").popitem()[1]["not_scored"] == "trained on this recording: no test"


@pytest.mark.parametrize("source", [None, "simulated"])
def test_a_card_without_logs_cannot_tell(source, linear, array, called, tmp_path):
    model = described(shutil.copytree(linear, tmp_path / "model"), logs=None, source=source)
    said = called("predict", model, array / "day1_0", "--out", tmp_path / "out", "--no-pictures")
    (one,) = answer(tmp_path / "out").values()
    assert one["scores"]["rmse (kPa)"] > 0
    warning = json.loads((tmp_path / "out" / "summary.json").read_text())["warning"]
    assert warning in said.splitlines()
    if source is None:
        assert warning.startswith("the model's card does not say which logs it was trained on; the scores of a log")
    else:
        assert "which simulated logs it was trained on" in warning
        assert warning.endswith("logs of a real sensor are none of them")
    (array_alone := tmp_path / "alone").mkdir()
    shutil.copy(array / "day1_0" / "array.log", array_alone)
    said = called("predict", model, array_alone, "--out", tmp_path / "out", "--no-pictures")
    assert "does not say" not in said and "scores" not in answer(tmp_path / "out").popitem()[1]


def test_pretrained_models_say_that_they_were_trained_on_simulated_logs():
    for path in ROOT.glob(f"pretrained/*/*/{cards.NAME}"):
        card = consistent.read(path.parent)
        assert card.source == "simulated"
        assert "simulated logs" in recordings.unknown(card) if card.logs is None else not recordings.unknown(card)


def test_maps_of_one_recording_at_a_time_are_in_memory(linear, array, called, tmp_path, monkeypatch):
    for k in range(5):
        shutil.copytree(array / "day1_1", tmp_path / "logs" / f"day{k}")
    predict, alive, most = recordings.predict, weakref.WeakSet(), []

    class Maps(np.ndarray):  # which a WeakSet can hold
        __hash__ = object.__hash__

    def counted(*given):
        most.append(len(alive))
        found = predict(*given)
        values = found.values.view(Maps)
        alive.add(values)
        return found._replace(values=values)

    monkeypatch.setattr(recordings, "predict", counted)
    called("predict", linear, tmp_path / "logs", "--no-pictures", "--out", tmp_path / "out")
    assert len(most) == 5 and max(most) <= 1  # those of the one before, until the name has the next


def test_a_recording_of_several_parts_is_summed_up_as_one_of_one(linear, array, called, tmp_path, monkeypatch):
    called("predict", linear, array / "day1_1", "--no-pictures", "--out", tmp_path / "whole")
    monkeypatch.setattr(schemas, "GROUP_ROWS", 100)
    called("predict", linear, array / "day1_1", "--no-pictures", "--out", tmp_path / "parts")
    whole, parts = ((tmp_path / name / "summary.json").read_text() for name in ("whole", "parts"))
    assert whole == parts and json.loads(whole)["recordings"][0]["readings"] > 1000
    tables = [schemas.read(tmp_path / name / "predictions.parquet") for name in ("whole", "parts")]
    assert str(tables[0].to_pylist()) == str(tables[1].to_pylist())  # NaN is not NaN, but is written as it


def test_predictions_that_are_held_on_the_disk_are_those_held_in_memory(linear, array, called, tmp_path, monkeypatch):
    called("predict", linear, array / "day1_1", "--out", tmp_path / "memory")
    monkeypatch.setattr(recordings, "LARGE", 0)
    monkeypatch.setattr(schemas, "GROUP_ROWS", 100)
    held = []
    monkeypatch.setattr(recordings, "release", lambda values, of=recordings.release: (held.append(values), of(values)))
    called("predict", linear, array / "day1_1", "--out", tmp_path / "disk")
    assert any(isinstance(values, np.memmap) for values in held)
    written = sorted(path.relative_to(tmp_path / "memory") for path in (tmp_path / "memory").rglob("*"))
    assert written == sorted(path.relative_to(tmp_path / "disk") for path in (tmp_path / "disk").rglob("*"))
    tables = [schemas.read(tmp_path / name / "predictions.parquet") for name in ("memory", "disk")]
    assert str(tables[0].to_pylist()) == str(tables[1].to_pylist())
    pictures = [path for path in written if path.suffix in (".png", ".gif")]
    assert len(pictures) == 2
    for path in pictures:
        assert (tmp_path / "memory" / path).read_bytes() == (tmp_path / "disk" / path).read_bytes()


def test_a_log_whose_maps_do_not_fit_onto_the_disk_is_listed_and_the_others_are_predicted(
    linear, array, called, tmp_path, monkeypatch, capsys
):
    shutil.copytree(array, tmp_path / "logs" / "single")
    long = tmp_path / "logs" / "single" / "day1_1" / "array.log"
    lines = long.read_text().splitlines(keepends=True)
    (tmp_path / "logs" / "single" / "day1_0" / "array.log").write_text("".join(lines[:100]))
    monkeypatch.setattr(recordings, "LARGE", 4 * 96 * 200)  # maps of 8 x 12
    usage = shutil.disk_usage(tmp_path)._replace(free=4 * 96 * (len(lines) - 100))
    monkeypatch.setattr(recordings.shutil, "disk_usage", lambda folder: usage)
    with pytest.raises(SystemExit, match="1 of 2 logs cannot be read .*; the others are predicted"):
        called("predict", linear, tmp_path / "logs", "--no-pictures", "--out", tmp_path / "out")
    said = capsys.readouterr().out
    assert "day1_1: the predictions of its" in said and "divide the log" in said
    assert [*answer(tmp_path / "out")] == ["single/day1_0"]


def clock_twice_too_fast(text: str) -> str:
    """Return lines whose times are twice what they were: `t,...`."""
    rows = [line.partition(",") for line in text.splitlines() if line[:1].isdigit()]
    return "\n".join(f"{2 * float(t):.6f},{rest}" if "." in t else f"{2 * int(t)},{rest}" for t, _, rest in rows)


SPOILED = {  # what happened to a log with ground truth
    "clock": clock_twice_too_fast,
    "torn": lambda text: text[: len(text) // 8],
    "lines": lambda text: "".join(line[:4] + "\n" for line in text.splitlines()),
    "empty": lambda text: "",
    "noise": lambda text: "\x00\x1f\x02" * 3000,
}


@pytest.fixture(scope="module")
def strain(tmp_path_factory) -> tuple[Path, Path, str]:
    """Return a package of strands that has seen none of the logs, the folder of one recording, and its truth's log."""
    folder = tmp_path_factory.mktemp("strain")
    own_logs.strain(folder / "logs", 5, 10.0, seconds=60.0)
    model = live_models.series(folder / "model")
    settings = params.load(ROOT / "params.yaml")["strain"]
    reading = {"sensor": {"channels": 5}, "window": live_models.SERIES["window"]}
    reading |= {"ingest": settings["ingest"] | {"rate_hz": 5, "max_reject_fraction": 0.1, "max_gap_s": 10.0}}
    described(model, reading=reading, protocol="task_2", logs=[])
    return model, next((folder / "logs" / "task_2").iterdir())


@pytest.mark.parametrize("kind", ["array", "strain"])
def test_one_bad_truth_does_not_stop_the_others(kind, array, linear, strain, called, tmp_path):
    model, good = (linear, array / "day1_1") if kind == "array" else strain
    truth = "load_cell.log" if kind == "array" else "robot.log"
    for number in range(8 - len(SPOILED)):
        shutil.copytree(good, tmp_path / "logs" / "task_2" / f"good{number}")
    for name, spoil in SPOILED.items():
        bad = shutil.copytree(good, tmp_path / "logs" / "task_2" / name) / truth
        bad.write_text(spoil(bad.read_text()))
    with pytest.raises(SystemExit, match="error: 5 of 8 logs cannot be scored; all are predicted"):
        called("predict", model, tmp_path / "logs", "--out", tmp_path / "out", "--no-pictures")
    found = {name.rpartition("/")[2]: each for name, each in answer(tmp_path / "out").items()}
    log = good / ("array.log" if kind == "array" else "daq.log")
    expected = {name: value for name, _, value, _ in recordings.scores(predictor.load(model), log)}
    for name, each in found.items():
        assert each["readings"] > 200 and each["without_prediction"] < 100
        if name.startswith("good"):
            first, value = next(iter(each["scores"].items()))
            assert value == pytest.approx(expected[first.partition(" ")[0]])
        else:
            assert each["scores"] is None and "held_out" not in each
            assert truth in each["not_scored"] or "does not share" in each["not_scored"], name


def test_the_truth_of_another_log_scores_nothing(linear, array, called, tmp_path):
    """A log that lies beside array.log under another name has a truth that is read with array.log alone."""
    folder = shutil.copytree(array / "day1_1", tmp_path / "run")
    shutil.copy(array / "day1_0" / "array.log", folder / "older.log")
    model = described(shutil.copytree(linear, tmp_path / "model"), logs=[])
    called("predict", model, folder / "older.log", "--out", tmp_path / "out", "--no-pictures")
    (one,) = answer(tmp_path / "out").values()
    assert "scores" not in one and one["highest_force_n"] > 0


def trained(called, monkeypatch, workspace, folder: Path) -> Path:
    """Return the folder of the model that a quick look at a target keeps."""
    monkeypatch.setattr(targets, "LOOK", Effort(300, 10))
    called("try", folder)
    return workspace.root / "build" / "own" / folder.name / "trained" / "target"


def held_out(workspace, name: str) -> pd.DataFrame:
    """Return metric -> value of the chosen models of a sensor, a row for each test."""
    scores = pd.read_csv(workspace.reports / "own" / name / "scores.csv")
    return scores[scores["model"] == "chosen on the other groups"].pivot(index="test", columns="metric", values="value")


def test_a_target_quotes_the_test_of_the_group_that_a_log_is_of(workspace, called, tmp_path, monkeypatch):
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint")
    model = trained(called, monkeypatch, workspace, folder)
    for name, how in {"anna_0": "mark", "ben_1": "CR LF", "cleo_0": "plain"}.items():
        repacked(folder / "bend" / name, tmp_path / "logs" / "x" / f"was {name}", how)
    free_targets.angles(tmp_path / "other", people=("dora",), seconds=20.0)
    shutil.copytree(tmp_path / "other" / "bend" / "dora_0", tmp_path / "logs" / "x" / "dora")
    said = called("predict", model, tmp_path / "logs", "--out", tmp_path / "out")
    found, tests = answer(tmp_path / "out"), held_out(workspace, "joint")
    assert found["x/dora"]["scores"]["R2"] > 0.5 and "coverage" in found["x/dora"]["scores"]
    for name in ("anna_0", "ben_1", "cleo_0"):
        one, (test, number) = found[f"x/was {name}"], (name[:-2], tests.loc[name[:-2]])
        assert (
            one["scores"] is None and one["not_scored"] == base_cards.SEEN and one["held_out_of"] == f"test of {test}"
        )
        assert one["held_out"]["RMSE (deg)"] == pytest.approx(number["RMSE"])
        assert one["held_out"]["R2"] == pytest.approx(number["R2"])
        quoted = f"held out (test of {test}): RMSE (deg) {number['RMSE']:.3g}, R2 {number['R2']:.3g}"
        assert f"trained on this recording: no test; {quoted}\n" in said
    assert len(tests["R2"].unique()) == 3
    called("predict", model, folder / "bend" / "ben_0" / "daq.log", "--out", tmp_path / "out")
    assert answer(tmp_path / "out").popitem()[1]["held_out"]["R2"] == pytest.approx(tests.loc["ben", "R2"])
    card = json.loads((model / "target.json").read_text())
    del card["logs"]
    (model / kept.CARD).write_text(base_cards.sealed(json.dumps(card), kept.CARD))
    said = called("predict", model, folder, "--out", tmp_path / "out")
    assert base_cards.UNKNOWN in said and all(each["scores"] for each in answer(tmp_path / "out").values()), "as before"


def test_a_recording_that_time_divides_quotes_the_mean_of_its_tests(workspace, called, tmp_path, monkeypatch):
    split = {"by": "time"}
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint", people=("anna",), split=split)
    said = called("predict", trained(called, monkeypatch, workspace, folder), folder, "--out", tmp_path / "out")
    tests = held_out(workspace, "joint")
    assert len(tests) == 5
    for one in answer(tmp_path / "out").values():
        assert one["scores"] is None and one["held_out"]["R2"] == pytest.approx(tests["R2"].mean())
    assert "within the same recordings: no interval for another recording" in said


@pytest.mark.parametrize("made", [free_targets.objects, free_targets.slips])
def test_classes_and_events_that_trained_are_not_scored(made, workspace, called, tmp_path, monkeypatch):
    """A class is the name of a folder, which may be another now."""
    folder = made(workspace.root / "data" / "own" / "mat")
    model = trained(called, monkeypatch, workspace, folder)
    shutil.copytree(folder, tmp_path / "logs")
    (first := min(path for path in (tmp_path / "logs").iterdir() if path.is_dir())).rename(first.with_name("a cup"))
    called("predict", model, tmp_path / "logs", "--out", tmp_path / "out")
    found, tests = answer(tmp_path / "out"), held_out(workspace, "mat")
    name = "right windows" if made is free_targets.objects else "F1 of windows"
    assert found and any(each.startswith("a cup/") for each in found)
    for each in found.values():
        assert each["scores"] is None and "right" not in each["held_out"]
        test = each["held_out_of"].removeprefix("test of ")
        assert each["held_out"][name] == pytest.approx(tests.loc[test, name])


def test_one_bad_truth_of_a_target_does_not_stop_the_others(workspace, called, tmp_path, monkeypatch):
    model = trained(called, monkeypatch, workspace, free_targets.angles(workspace.root / "data" / "own" / "joint"))
    logs = free_targets.angles(tmp_path / "new", people=("a", "b", "c", "dora"), seconds=20.0) / "bend"
    for person in "abc":
        shutil.rmtree(logs / f"{person}_0")
        shutil.rmtree(logs / f"{person}_1")
    spoiled = SPOILED | {
        "clock": lambda text: "".join(f"{float(line.split(',')[0]) + 900},1,0\n" for line in text.split())
    }
    for name, spoil in spoiled.items():
        bad = shutil.copytree(logs / "dora_0", logs / name) / "arm.log"
        bad.write_text(spoil(bad.read_text()))
    with pytest.raises(SystemExit, match="5 of 7 logs cannot be scored; all are predicted"):
        called("predict", model, logs, "--out", tmp_path / "out")
    for name, each in answer(tmp_path / "out").items():
        assert each["readings"] == 200
        if name in spoiled:
            assert each["scores"] is None and "arm.log" in each["not_scored"], name
        else:
            assert each["scores"]["R2"] > 0.5
    with pytest.raises(SystemExit, match="1 of 1 logs cannot be scored; all are predicted"):
        called("predict", model, logs / "clock", "--out", tmp_path / "out")
    assert len(answer(tmp_path / "out")) == 1


def test_an_interval_of_a_target_carries_the_coverage_of_its_tests(workspace, called, tmp_path, monkeypatch):
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint")
    model = trained(called, monkeypatch, workspace, folder)
    card = kept.Card.model_validate_json((model / "target.json").read_text())
    assert {test: scores["coverage"] for test, scores in card.tests.items()} == held_out(workspace, "joint")[
        "coverage"
    ].to_dict()

    def sentence(coverage: dict[str, float], groups=("anna", "ben", "cleo"), **changed) -> str:
        tests = {test: {"coverage": share} for test, share in coverage.items()}
        other = card.model_copy(update={"tests": tests, "groups": list(groups)} | changed)
        base_cards.write(model / kept.CARD, other, exclude_none=True)
        said = called("predict", model, folder, "--out", tmp_path / "out")
        (interval,) = json.loads((tmp_path / "out" / "summary.json").read_text())["interval"]
        assert interval in said.splitlines()
        return interval.partition("of other parts of the groups")[2]

    assert sentence({"anna": 0.9, "ben": 0.87, "cleo": 0.94}) == ""
    assert sentence({"anna": 0.99, "ben": 0.9, "cleo": 0.69}) == "; on held-out persons it held 69 % (cleo)"
    assert sentence({}, ("anna",)) == "; within one person: no interval for another person"
    assert sentence({"ben": 0.1}, ("anna",), by="session") == (
        "; on held-out sessions it held 10 % (ben); within one session: no interval for another session"
    )
    assert sentence({"ben": 0.1}, bound=None) == "", "there is no interval"
