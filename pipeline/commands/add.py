"""Write the skeleton of a model, a claim or a stress test into a checkout: it runs as it is, to be changed from there.

KIND is one of model, claim and stress; NAME is what code and settings call it. A model of windows is ridge regression
in tactile/models/NAME.py and its line in params/EXPERIMENT.yaml. A claim is an entry in claims/NAME.yaml, which the
stage `judge` reads. A stress test is a function in pipeline/stability/perturbations.py and its severities in
params.yaml. docs/design.md says what else a model or an experiment may have.

Examples:

    tactile add model whole_ridge
    tactile add claim mine
    tactile add stress sagging_supply --experiment strain
"""

import argparse
import keyword
from pathlib import Path

from tactile import experiments
from tactile.base import files, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

MODEL = '''\
"""Build {name}: ridge regression from the whole window to the whole map."""

from pydantic import Field
from sklearn.linear_model import Ridge

from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, NotNegative


class Settings(Block):
    """Settings of a model `{name}` in params.yaml."""

    ridge: NotNegative = Field(description="Weight of the squared coefficients")


def build(spec: Spec, *, ridge: float) -> SklearnRegressor:
    """Return the unfitted model."""
    return SklearnRegressor(lambda seed: Ridge(ridge), spec, count=lambda fitted: fitted.coef_.size, macs=None)
'''
MODEL_SETTINGS = "    {name}: {{ridge: 1.0}}\n"
CLAIM = """\
paper: lomp
claims:
  - id: {name}
    text: On two touches LoMP errs less than a linear regression does, by {{published:.1f}} kPa.
    source: Table I
    above: double.linear - double.lomp
    control: {{lomp: constant}}
"""
STRESS = '''

@stress_test("{kind}", unit="share of the range", acts_on="readings")
def {name}(readings: np.ndarray, severity: float, rng: np.random.Generator, *, span: float) -> np.ndarray:
    """Take the same share of the range from all elements."""
    return _same_kind(readings, readings - severity * span)
'''
SEVERITIES = "      {name}: [0.1, 0.5]            # share of each channel's range\n"
KINDS = ("model", "claim", "stress")
CHECK = 'python -m pytest tests/general -m "not slow" -n 2'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add kind, name and experiment to the parser of this command."""
    parser.add_argument("kind", metavar="KIND", choices=KINDS, help=f"one of {', '.join(KINDS)}")
    parser.add_argument("name", metavar="NAME", help="lower-case letters, digits and underscores")
    parser.add_argument("--experiment", default="touch", help="whose settings get it (default %(default)s)")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write the skeleton, and say what to run; InputError where the name is taken or is none."""
    name, experiment = given.name, given.experiment
    if not name.isidentifier() or keyword.iskeyword(name) or name != name.lower() or not name.isascii():
        raise InputError(f"'{name}' cannot be a name in code; write lower-case letters, digits and underscores")
    if given.kind != "claim" and paths.CODE.parent.resolve() != workspace.root.resolve():
        raise InputError(f"{workspace.root}: code is added to a checkout of this project; run the command in one")
    if given.kind != "claim" and experiment not in experiments.NAMES:
        raise InputError(f"there is no experiment '{experiment}'; known: {', '.join(experiments.NAMES)}")
    written, then = {"model": _model, "claim": _claim, "stress": _stress}[given.kind](workspace.root, name, experiment)
    print(*(f"written: {path.relative_to(workspace.root)}" for path in written), *then, sep="\n")


def _claim(root: Path, name: str, experiment: str) -> tuple[list[Path], list[str]]:
    path = _free(root / "claims" / f"{name}.yaml")
    files.write_text(path, CLAIM.format(name=name.replace("_", "-")))
    return [path], [
        "pipeline/claims/entries.py says what an entry may say; `python -m pipeline.stages.judge` judges it"
    ]


def _model(root: Path, name: str, experiment: str) -> tuple[list[Path], list[str]]:
    if experiments.module(experiment).KIND != "windows":
        raise InputError(f"{experiment}: the skeleton is of a model of windows, and these see none; copy one of theirs")
    code, settings = _free(root / "tactile" / "models" / f"{name}.py"), root / "params" / f"{experiment}.yaml"
    changed = _after(settings, ["  models:"], MODEL_SETTINGS.format(name=name))
    files.write_text(code, MODEL.format(name=name))
    files.write_text(settings, changed)
    return [code, settings], [f"`{CHECK}` holds it to the contract of models; `dvc repro` trains it"]


def _stress(root: Path, name: str, experiment: str) -> tuple[list[Path], list[str]]:
    code, settings = root / "pipeline" / "stability" / "perturbations.py", root / "params.yaml"
    text = code.read_text(encoding="utf-8")
    if f"def {name}(" in text:
        raise InputError(f"{code}: there is a stress test '{name}'; choose another name")
    within = ["stress:", f"  {experiment}:", "    perturbations:"]
    changed = _after(settings, within, SEVERITIES.format(name=name))
    files.write_text(code, text + STRESS.format(name=name, kind=experiments.module(experiment).KIND))
    files.write_text(settings, changed)
    return [code, settings], [f"`{CHECK}` holds it to the contract of stress tests; `dvc repro` computes it here"]


def _free(path: Path) -> Path:
    """Return a path at which nothing is; InputError where something is."""
    if path.exists():
        raise InputError(f"{path}: is there already; choose another name")
    return path


def _after(path: Path, headings: list[str], line: str) -> str:
    """Return the text of a file of settings with a line more behind the headings, each below the one before."""
    lines, at = path.read_text(encoding="utf-8").splitlines(keepends=True), -1
    for heading in headings:
        at = next((k for k in range(at + 1, len(lines)) if lines[k].partition("#")[0].rstrip() == heading), None)
        if at is None:
            raise InputError(f"{path}: no line '{heading.strip()}' for it to stand behind; write it by hand")
    return "".join([*lines[: at + 1], line, *lines[at + 1 :]])
