"""What CI does before the tests: a browser where one can be had, and no failure where none can."""

import os
import shutil
import subprocess

import pytest
from builders.project import ROOT

TOOLS = ("awk", "bash", "cat", "chmod", "dirname", "env", "git", "id", "mktemp", "rm", "sed", "tail", "timeout")
INSTALLS = """echo "$@" >>"$LOG"
case "$*" in *install*) echo '#!/bin/sh' >"$BIN/chromium"; chmod +x "$BIN/chromium" ;; esac"""
README = "# X\n\n## Test it\n\n```bash\ntype -P chromium || echo none; echo tested\n```\n"


@pytest.fixture
def run(tmp_path):
    """Run .ci/run on a project of one line, with these programs (name -> script) beside TOOLS; what it printed."""
    project, programs = tmp_path / "project", tmp_path / "bin"
    shutil.copytree(ROOT / ".ci", project / ".ci")
    (project / "README.md").write_text(README)
    programs.mkdir()
    for tool in TOOLS:
        (programs / tool).symlink_to(shutil.which(tool))
    (programs / "sudo").write_text('#!/usr/bin/env bash\nshift\nexec "$@"\n')
    identity = ["-c", "user.name=x", "-c", "user.email=x@example.org"]
    for arguments in (["init", "-q"], ["add", "."], [*identity, "commit", "-qm", "x"]):
        subprocess.run(["git", *arguments], cwd=project, check=True)

    def run(**scripts: str) -> str:
        for name, script in scripts.items():
            (programs / name.replace("_", "-")).write_text(f"#!/usr/bin/env bash\n{script}\n")
        for path in programs.iterdir():
            if not path.is_symlink():
                path.chmod(0o755)
        environment = {key: value for key, value in os.environ.items() if key != "CHROMIUM"}
        environment |= {"PATH": str(programs), "BIN": str(programs), "LOG": str(tmp_path / "apt.log")}
        command = [shutil.which("bash"), project / ".ci" / "run"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_chromium_is_installed_where_there_is_none(run, tmp_path):
    said = run(apt_get=INSTALLS)
    assert said.endswith(f"{tmp_path / 'bin' / 'chromium'}\ntested\n") and "no Chromium" not in said
    said = (tmp_path / "apt.log").read_text().splitlines()
    assert said[0].endswith(" update") and said[1].endswith(" install -y --no-install-recommends chromium")


def test_chromium_is_left_alone_where_there_is_one(run, tmp_path):
    assert run(apt_get=INSTALLS, google_chrome="true").endswith("tested\n")
    assert not (tmp_path / "apt.log").exists()


@pytest.mark.parametrize("apt", [{"apt_get": 'echo "E: no network" >&2; exit 100'}, {}], ids=["no network", "no apt"])
def test_without_packages_the_tests_still_run(run, apt):
    said = run(**apt)
    assert said.endswith("none\ntested\n") and ("no Chromium: E: no network" in said) == bool(apt)
