"""What the checks before a commit ask of the whole tree: lint, format, spelling, types, and files that hosts read."""

import re
import subprocess
import sys
import tomllib

import pytest
import yaml
from builders.project import ROOT

CHECKS = (["ruff", "check", "."], ["ruff", "format", "--check", "."], ["codespell_lib"], ["mypy"])


@pytest.mark.parametrize("command", CHECKS, ids=" ".join)
def test_the_tree_is_clean(command):
    done = subprocess.run([sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]


def test_the_checks_before_a_commit_are_those_of_the_workflow():
    """A hook that the workflow lacks, or the other way round, would pass here and fail there."""
    (local,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    hooks = {hook["entry"].replace(" --force-exclude", "") for hook in local["hooks"]}
    steps = yaml.safe_load((ROOT / ".github/workflows/tests.yml").read_text())["jobs"]["style"]["steps"]
    assert {part.removesuffix(" .") for part in steps[-1]["run"].split(" && ")} == hooks
    assert hooks == {"ruff check", "ruff format --check", "codespell", "mypy"}


def test_a_workflow_runs_what_this_repository_has():
    """Commands that name files name files that are there, and every workflow says what it may do.

    A job that may write publishes what another one has built, and runs nothing of the repository, which it lacks.
    """
    for path in sorted((ROOT / ".github" / "workflows").glob("*.yml")):
        workflow = yaml.safe_load(path.read_text())
        assert workflow["permissions"] == {"contents": "read"}, path
        writing = [step for job in workflow["jobs"].values() if "permissions" in job for step in job["steps"]]
        publishing = ("actions/deploy-pages@", "actions/download-artifact@", "gh release create ")
        assert all(step.get("uses", step.get("run")).startswith(publishing) for step in writing), path
        runs = [step["run"] for job in workflow["jobs"].values() for step in job["steps"] if "run" in step]
        named = {word for run in runs for word in run.split() if word in (".ci/run", "constraints.txt")}
        assert named and all((ROOT / name).is_file() for name in named), path


def test_one_version_is_said_everywhere():
    """A tag of it releases the notes that CHANGELOG.md has below that version."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    released = re.findall(r"^## (\S+) \((.+)\)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    date = citation["date-released"]
    assert released[0] == (version, f"{date.day} {date:%B %Y}") and citation["version"] == version
