"""Your own files: what DVC does with links, and the refusal of places where it would not notice a change."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from builders.project import ROOT

from tactile import experiments
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.params_file import copied
from tactile.base.paths import Workspace
from tactile.commands import check, command_line, own
from tactile.logs import own_data
from tactile.stages import ingest

LOG = "finger/single/run000/array.log"


def put(folder):
    """A log in `folder`, which is made."""
    log = folder / LOG
    log.parent.mkdir(parents=True)
    log.write_text("1,2\n")
    return folder / "finger"


def plain(place, elsewhere):
    put(place)


def hard_link(place, elsewhere):
    put(elsewhere)
    (place / LOG).parent.mkdir(parents=True)
    os.link(elsewhere / LOG, place / LOG)


def links_to_files(place, elsewhere):
    put(elsewhere)
    (place / LOG).parent.mkdir(parents=True)
    (place / LOG).symlink_to(elsewhere / LOG)


def own_is_a_link(place, elsewhere):
    put(elsewhere)
    place.symlink_to(elsewhere)


def link_to_a_folder(place, elsewhere):
    place.mkdir()
    (place / "finger").symlink_to(put(elsewhere))


def link_to_a_folder_below(place, elsewhere):
    put(elsewhere)
    (place / "finger" / "single").mkdir(parents=True)
    (place / "finger" / "single" / "run000").symlink_to((elsewhere / LOG).parent)


NOTICED = (plain, hard_link, links_to_files, own_is_a_link)
UNNOTICED = (link_to_a_folder, link_to_a_folder_below)


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    return Workspace(tmp_path / "project")


@pytest.fixture
def root(workspace):
    """The root of a workspace with nothing in data/own; there is room beside it."""
    (workspace.root / "data" / "own").mkdir(parents=True)
    copied(ROOT / "params.yaml", workspace.root)
    return workspace.root


@pytest.mark.parametrize("way", NOTICED)
def test_logs_that_dvc_watches_are_taken(workspace, way, root, tmp_path):
    place = root / "data" / "own"
    place.rmdir()
    way(place, tmp_path / "elsewhere")
    assert (
        own_data.unnoticed(workspace, place / "finger") is None and own_data.unnoticed(workspace, place / LOG) is None
    )
    assert own_data.argument(workspace, place / "finger") == "data/own/finger"


@pytest.mark.parametrize("way", UNNOTICED)
def test_a_link_to_a_folder_is_refused_with_the_command_that_fixes_it(workspace, way, root, tmp_path):
    place = root / "data" / "own"
    place.rmdir()
    way(place, tmp_path / "elsewhere" / "it's here")
    said = own_data.unnoticed(workspace, place / "finger")
    link = place / "finger" if way is link_to_a_folder else (place / LOG).parent
    assert said.startswith(f"{link} is a link to a folder, which is not followed; ")
    assert "\n" not in said
    if way is link_to_a_folder:
        assert own_data.unnoticed(workspace, place / LOG) == said
    command = said.split("`")[-2]
    assert shlex.split(command)[:2] == ["rm", str(link)]
    if shutil.which("cp") and subprocess.run(command, shell=True, capture_output=True).returncode == 0:  # GNU's cp
        assert own_data.unnoticed(workspace, place / "finger") is None and (place / LOG).read_text() == "1,2\n"


def test_a_link_within_is_refused_too(workspace, root):
    """It could be made to lead elsewhere, which DVC would not see either."""
    put(root / "data" / "own" / "store")
    (root / "data" / "own" / "now").symlink_to("store")
    assert "data/own/now is a link to a folder" in own_data.unnoticed(workspace, root / "data" / "own" / "now")
    assert "data/own/now is a link to a folder" in own_data.unnoticed(
        workspace, root / "data" / "own" / "now" / "finger"
    )
    (root / "data" / "own" / "store" / "loop").symlink_to("..")
    assert "data/own/store/loop is a link to a folder" in own_data.unnoticed(workspace, root / "data" / "own" / "store")


def test_a_link_that_leads_to_nothing_is_refused(workspace, root):
    (put(root / "data" / "own") / "gone.log").symlink_to("nowhere.log")
    said = own_data.unnoticed(workspace, root / "data" / "own" / "finger")
    assert said.endswith("gone.log is a link that leads to nothing; fix or remove it")
    assert own_data.linked(root / "data" / "own" / "finger") == said


@pytest.mark.parametrize("source", ["../ext/finger", "data/own/../../../ext/finger", "{outside}"])
def test_ingest_refuses_logs_outside(workspace, source, root):
    outside = put(root.parent / "ext")
    with pytest.raises(InputError) as error:
        ingest.ingest(
            workspace, "touch", params.load(ROOT / "params.yaml")["touch"] | {"source": source.format(outside=outside)}
        )
    said, named = str(error.value), root / source.format(outside=outside)
    assert said.startswith(
        f"params/touch.yaml, touch.source: {named} is not in data/own, so `dvc repro` would not notice "
    )
    assert said.endswith(f"`cp -rs {outside} {root / 'data' / 'own' / 'finger'}`")
    assert not workspace.frames("touch").exists()


@pytest.mark.parametrize("experiment", experiments.having("log"))
def test_ingest_refuses_a_link_to_a_folder(workspace, experiment, root, tmp_path):
    link_to_a_folder(root / "data" / "own" / "it", tmp_path / "elsewhere")
    settings = params.load(ROOT / "params.yaml")[experiment] | {"source": "data/own/it/finger"}
    with pytest.raises(
        InputError, match=rf"^params/{experiment}\.yaml, {experiment}\.source: .*/finger is a link to a folder, "
    ):
        ingest.ingest(workspace, experiment, settings)


def test_check_names_commands_that_take_the_folder(workspace, root, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(check, "check", lambda *arguments: None)  # all else is right

    def said(folder):
        monkeypatch.setattr(sys, "argv", ["tactile", "check", "touch", str(folder), "--root", str(root)])
        command_line.main()
        return capsys.readouterr().out.partition("`tactile try ")[2].partition("`")[0]

    put(root / "data" / "own")
    monkeypatch.chdir(root / "data" / "own" / "finger")
    assert said(Path()) == "data/own/finger" and own.name_of(workspace, Path()) == "finger"
    inside = put(root / "bench")
    assert said(inside) == own.name_of(workspace, inside) == "bench/finger"
    outside = put(tmp_path / "else where")
    with pytest.raises(InputError, match=f"{outside}: lies outside of {root}; add `--root '{outside.parent}'`"):
        own.name_of(workspace, outside)
    assert said(outside) == f"'{outside}' --root '{outside.parent}'"


def test_check_refuses_links_that_own_would_not_follow(root, tmp_path, monkeypatch):
    place = root / "data" / "own"
    place.rmdir()
    link_to_a_folder_below(place, tmp_path / "elsewhere")
    monkeypatch.setattr(check, "check", lambda *arguments: None)
    monkeypatch.setattr(sys, "argv", ["tactile", "check", "touch", str(place / "finger"), "--root", str(root)])
    with pytest.raises(SystemExit, match="^fix first: .*run000 is a link to a folder, which is not followed; "):
        command_line.main()
