"""`tactile inspect` says what a package holds, also of a broken one, and loads nothing of it."""

import argparse
import hashlib
import json
import zipfile

import pytest
from builders import live_models
from builders.project import ROOT

from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import command_line, inspect
from tactile.inference import card as cards
from tactile.targets import kept


@pytest.fixture(autouse=True)
def nothing_is_loaded(monkeypatch):
    for name in ("skops.io.load", "safetensors.torch.load_file", "onnxruntime.InferenceSession"):
        monkeypatch.setattr(name, None)


def said(folder, capsys) -> tuple[list[str], str]:
    """Return the lines that the command prints, and the error that it ends with."""
    error = ""
    try:
        inspect.main(Workspace(ROOT), argparse.Namespace(folder=folder, json=False, quiet=False))
    except InputError as raised:
        error = str(raised)
    return capsys.readouterr().out.splitlines(), error


@pytest.mark.parametrize("name", ["touch/lomp_stream", "strain/lstm_direct", "glove/sp_resnet"])
def test_a_whole_package_is_told(name, capsys):
    folder = ROOT / "pretrained" / name
    lines, error = said(folder, capsys)
    card = json.loads((folder / cards.NAME).read_text())
    made = f"commit {card['commit']}" + (f", version {card['version']}" if "version" in card else "")
    assert not error and f"model: {name}, {card['protocol']}, seed 0, of {made}" in lines
    for file in {*cards.WEIGHTS, cards.NAME, cards.ONNX} & {path.name for path in folder.iterdir()}:
        data = (folder / file).read_bytes()
        digest = hashlib.sha256(data).hexdigest()[:16]
        assert f"{file}: {len(data)} bytes, SHA-256 {digest}, as the card names it" in lines
    assert "read by nothing: README.md" in lines
    assert any("holds: 1 Add, 1 Concat" in line and "1 LSTM" in line for line in lines) == name.startswith("strain")


def test_a_changed_package_is_told_with_what_is_wrong(tmp_path, capsys):
    folder = live_models.linear(tmp_path / "model")
    lines, error = said(folder, capsys)
    assert not error and any(line.startswith("estimator.skops holds: ") and "StandardScaler" in line for line in lines)
    with zipfile.ZipFile(folder / "estimator.skops", "a") as archive:
        archive.writestr("more", "")
    (folder / cards.ONNX).write_bytes(b"no network")
    lines, error = said(folder, capsys)
    assert [line.partition(":")[0] for line in lines if "NOT as the card names it" in line] == [
        "estimator.skops",
        "model.onnx",
    ]
    wrong = [line for line in lines if line.startswith("wrong: ")]
    assert len(wrong) == 3 and any("not a file of ONNX" in line for line in wrong), "and model.onnx is not named"
    assert error.startswith(f"{folder}: 3 things wrong, the first: {folder}/estimator.skops: is not the file that")
    found = inspect.inspected(folder)
    assert json.loads(json.dumps(found)) == found and found["files"]["card.json"]["named"]
    (folder / "estimator.skops").unlink()
    lines, _ = said(folder, capsys)
    assert "estimator.skops: not there, NOT as the card names it" in lines


def test_a_card_that_cannot_be_read_is_told_and_its_files_all_the_same(tmp_path, capsys):
    folder = live_models.stream(tmp_path / "model")
    for text in ("{", "[]", json.dumps({"sha256": "0" * 64}), "\x1b[31m", "\ud800".encode("utf-8", "replace").decode()):
        (folder / cards.NAME).write_text(text)
        lines, error = said(folder, capsys)
        assert any(line.startswith("network.safetensors: ") and "cannot be read" in line for line in lines)
        assert error.startswith(f"{folder}: 1 thing wrong, the first: {folder}/card.json")
        assert all(line.isprintable() for line in lines)
    (folder / cards.NAME).unlink()
    lines, error = said(folder, capsys)
    assert "card.json: not there, the card cannot be read" in lines and "card.json: not found" in error
    with pytest.raises(InputError, match=r"no target\.json or card\.json in it"):
        inspect.inspected(tmp_path)


def test_the_model_of_a_target_is_told(tmp_path, capsys):
    folder = live_models.target(tmp_path / "model", ("can", "cup"))
    lines, error = said(folder, capsys)
    assert not error and "gives: can, cup" in lines
    assert any("3 sklearn.tree._tree.Tree" in line for line in lines)
    assert inspect.inspected(folder)["holds"]["estimator.skops"]["sklearn.tree._tree.Tree"] == 3
    (folder / kept.CARD).write_text((folder / kept.CARD).read_text().replace('"deg"', '"mm"').replace("pad", "mat"))
    _, error = said(folder, capsys)
    assert "target.json: is not as it was written" in error


def test_a_damaged_file_of_weights_is_a_sentence(tmp_path):
    folder = live_models.stream(tmp_path / "model")
    weights = folder / "network.safetensors"
    whole = weights.read_bytes()
    for data in (b"", b"\xff" * 8, whole[:20], b"\x05\0\0\0\0\0\0\0[1,2]", b"\x02\0\0\0\0\0\0\0{}"):
        weights.write_bytes(data)
        found = inspect.inspected(folder)
        assert len(found["wrong"]) in (1, 2) and list(inspect.lines(found))


def test_the_command_is_listed():
    assert "inspect" in command_line.GROUPS["Use a trained model"]
