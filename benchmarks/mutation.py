"""Faults put into named functions on purpose: do their fast tests see them?

    python benchmarks/mutation.py [--sample N] [--seed S] [NAME ...]

Every comparison, sum, number, index, axis, `not`, `and`, min, name of a part and bare call of the functions below can
be changed. Of a call, an argument can be left out, taken from its neighbour or reversed in time, and of two arrays the
first row of one can stand for all of its rows. A sample of these mutants is made, of all functions or those named, one
by one in a copy of the tracked files, where its tests run. Those that no test sees are listed, with exit status 1. Not
all of them are a lack: some change nothing that can be seen.
"""

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

ROOT, LIMIT_S = Path(__file__).resolve().parent.parent, 300
ALL = "*"  # functions of a file

SELECTION, SERIES, VERDICTS = "stages/test_selection.py", "models/test_series_models.py", "claims/test_verdicts.py"
PAIRING, ONE_LOG, SPECIMENS = (f"general/test_{name}.py" for name in ("pairing", "one_log", "specimens"))
FITTED, TRACKED, KEPT = (
    "inference/test_outside_training.py",
    "inference/test_tracked_numbers.py",
    "targets/test_kept_target.py",
)
INTERVALS, LIVE = "inference/test_prediction_intervals.py", "live/test_live_session.py live/test_live_stream.py"
UNITS = "logs/test_sizes_of_units.py logs/test_units_in_headers.py logs/test_units_in_lines.py"
# file, or pattern of files -> functions and constants whose faults are wrong numbers in silence (ALL: of
# all that it has), and tests that should see them
CHOSEN = {
    "pipeline/stability/*.py": (ALL, f"stability {SELECTION}"),
    "tactile/tasks/*.py": (ALL, f"{SELECTION} stages/test_fitted_parts.py general/test_latency.py"),
    "tactile/base/ranges.py": ("of excess outside of_areas", f"{FITTED} {KEPT}"),
    "tactile/inference/training.py": (ALL, FITTED),
    "tactile/inference/intervals.py": (ALL, INTERVALS),
    "tactile/inference/calibration.py": (
        "calibrated _bound _coverage _of_series _without_validation _blocks",
        INTERVALS,
    ),
    "pipeline/tracking/mlflow_runs.py": ("_run evidence look", f"{TRACKED} general/test_tracked_weights.py"),
    "pipeline/results/published.py": ("number score", TRACKED),
    "tactile/targets/kept.py": ("write trained_on predict _outside", KEPT),
    "tactile/targets/features.py": ("windows statistics firsts columns", f"{KEPT} targets/test_grouped.py"),
    "pipeline/studies/counts.py": ("count _row", "general/test_golden.py"),
    "tactile/live/*.py": ("take _predict _evaluated _start _choose_step add fields picture", LIVE),
    "tactile/logs/units.py": (ALL, UNITS),
    "pipeline/studies/variants.py": ("run fit of_base rows", f"{SELECTION} studies/test_variants.py"),
    "pipeline/studies/joined_frames.py": ("scores", "studies/test_input_frames.py"),
    "pipeline/studies/latent.py": ("decoded", f"{SERIES} studies/test_latent.py"),
    "pipeline/studies/joint_angles.py": ("named", "experiments/test_glove_recorded.py"),
    "tactile/learning/training.py": (
        "run_epochs rate_at",
        "learning/test_training.py general/test_contract_of_models.py",
    ),
    "tactile/learning/regressors.py": ("fit update zero_linear _of_an_epoch", "learning/test_regressors.py"),
    "tactile/learning/image_classifier.py": ("augmented train_on", "learning/test_image_classifier.py"),
    "tactile/learning/series_regressors.py": ("fit __init__", SERIES),
    "tactile/learning/lstm.py": ("_freeze", SERIES),
    "tactile/learning/lomp_network.py": ("forward", "learning/test_lomp_network.py"),
    "tactile/learning/lomp_shape.py": ("neighbour_matrix", "learning/test_lomp_network.py"),
    "tactile/learning/lomp_prediction.py": ("update_gru", "learning/test_lomp_network.py"),
    "tactile/learning/residual_blocks.py": ("forward", "models/test_image_models.py"),
    "tactile/models/lstm_highpass.py": ("fit", SERIES),
    "tactile/models/lomp_stream.py": ("train_epoch _maps", "models/test_lomp_stream.py"),
    "tactile/experiments/touch.py": ("split _ground_truth", "experiments/test_splits.py stages/test_touch_ingest.py"),
    "tactile/experiments/strain_recorded.py": ("split", "experiments/test_strain_recorded.py"),
    "tactile/experiments/velostat_recorded.py": ("split", "experiments/test_splits.py"),
    "tactile/experiments/glove.py": ("split joint_means", "experiments/test_glove.py"),
    "tactile/datasets/series.py": ("chronological seen_in_training", SERIES),
    "tactile/datasets/labels.py": ("pressure_maps", "datasets/test_labels.py"),
    "tactile/datasets/windowing.py": ("window_rows windows_table", "datasets/test_windowing.py"),
    "tactile/datasets/images.py": ("normalised", "experiments/test_glove.py"),
    "tactile/datasets/specimens.py": ("drawn of_seed number", SPECIMENS),
    "pipeline/scenes/readout.py": ("column_voltage", "scenes/test_touch_scene.py"),
    "tactile/stages/ingest.py": ("_write_frames", "stages/test_touch_ingest.py"),
    "pipeline/stages/latency.py": ("prediction_times training_seconds fastest main", "general/test_latency.py"),
    "tactile/scoring/metrics.py": (
        "touch series overall unless_failed",
        "scoring/test_metrics.py learning/test_trained.py",
    ),
    "tactile/scoring/classification.py": ("scores", "scoring/test_classification.py"),
    "pipeline/results/frame_sets.py": ("drawn_sets", "studies/test_input_frames.py"),
    "tactile/scoring/estimates.py": ("estimate", "scoring/test_results.py"),
    "pipeline/claims/sizes.py": ("verdict judge excesses", f"{PAIRING} studies/test_sizes.py"),
    "pipeline/claims/physics.py": ("_change", PAIRING),
    "pipeline/claims/equivalence.py": ("inside lies_within", VERDICTS),
    "tactile/scoring/conformal.py": ("quantile half_width class_threshold class_sets", "scoring/test_conformal.py"),
    "tactile/targets/validate.py": ("tests parts final calibrated fitted covered", f"targets/test_grouped.py {KEPT}"),
    "tactile/models/rnn.py": ("forward", "general/test_time_order.py"),
    "tactile/live/session.py": ("_is_predicted", ONE_LOG),
    "tactile/inference/timing.py": ("most_filled between", ONE_LOG),
    "pipeline/scenes/touch_stress.py": ("plan", f"{SPECIMENS} stability/test_stress_windows.py"),
    "pipeline/stages/metrics.py": ("of_experiment", "general/test_golden.py"),
    "pipeline/claims/rules.py": ("above near within order timed BAND", VERDICTS),
    "pipeline/claims/expressions.py": ("evaluate _value", VERDICTS),
}
SWAPPED = {
    **{ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq},
    **{ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And},
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult},
}
NAMES = {"min": "max", "argmin": "argmax", "nanmin": "nanmax", "minimum": "maximum", "any": "all", "train": "test"}
NAMES |= {other: name for name, other in NAMES.items()} | {"validation": "test", "test": "validation"}


ARRAYS = (ast.Name, ast.Attribute, ast.Subscript)  # what may be an array


class Mutant(NamedTuple):
    """A file of the code with one fault, `what`, and the tests that should see it."""

    file: str
    what: str
    source: str
    tests: str


def faults_of_arguments(call: ast.Call) -> Iterator[ast.AST]:
    """Yield a call with an argument left out, taken from its neighbour, or with the first axis, time, reversed."""
    for place, given in enumerate(call.args):
        beside = call.args[place + 1 : place + 2] or call.args[:place][-1:]
        others = [
            other for other in beside if not isinstance(other, ast.Starred) and not isinstance(given, ast.Starred)
        ]
        if isinstance(given, ARRAYS):
            others.append(sliced(given, "[::-1]"))
        for other in others:
            if ast.unparse(other) != ast.unparse(given):
                yield ast.Call(call.func, [*call.args[:place], other, *call.args[place + 1 :]], call.keywords)
    if len(call.args) > 1:
        yield ast.Call(call.func, call.args[:-1], call.keywords)
    for keyword in call.keywords:
        yield ast.Call(call.func, call.args, [other for other in call.keywords if other is not keyword])


def sliced(node: ast.expr, index: str) -> ast.expr:
    """Return a node with an index, as `[:1]`."""
    return ast.parse(f"({ast.unparse(node)}){index}", mode="eval").body


def faults(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what a node of the syntax tree can be changed to."""
    changed = copy.deepcopy(node)
    if isinstance(node, ast.Call):
        yield from faults_of_arguments(node)
    if isinstance(node, ast.BinOp) and isinstance(node.right, ARRAYS):
        yield ast.BinOp(node.left, node.op, sliced(node.right, "[:1]"))  # the first row is broadcast
    if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPPED:
        changed.ops[0] = SWAPPED[type(node.ops[0])]()
    elif isinstance(node, (ast.BinOp, ast.BoolOp)) and type(node.op) in SWAPPED:
        changed.op = SWAPPED[type(node.op)]()
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
        changed = changed.operand
    elif isinstance(node, ast.keyword) and node.arg == "axis" and isinstance(node.value, ast.Constant):
        changed.value = ast.Constant(0 if node.value.value else 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        changed.value = not node.value
    elif isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        changed.value = node.value + 1
    elif isinstance(node, ast.Constant) and node.value in ("train", "validation", "test"):
        changed.value = NAMES[node.value]
    elif isinstance(node, ast.Name) and node.id in ("min", "max", "any", "all"):
        changed.id = NAMES[node.id]
    elif isinstance(node, ast.Attribute) and node.attr in NAMES:
        changed.attr = NAMES[node.attr]
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        changed = ast.Pass()
    else:
        return
    yield changed
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Sub, ast.Div)):
        yield ast.BinOp(node.right, node.op, node.left)


def places(tree: ast.Module, file: str, name: str) -> list[ast.AST]:
    """Return the functions and constants of a file that have a name, of ALL all functions; ValueError without one."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    inner = {node for function in functions for part in function.body for node in ast.walk(part)}
    found = [node for node in functions if node.name == name or (name == ALL and node not in inner)]
    found += [node for node in tree.body if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name]
    if not found:
        raise ValueError(f"{file} has no {name}; bring CHOSEN up to date")
    return found


def chosen() -> Iterator[tuple[str, list[str], str]]:
    """Yield each file of CHOSEN, those of a pattern that have one of its names, with these names and the tests."""
    for pattern, (names, tests) in CHOSEN.items():
        paths = sorted(ROOT.glob(pattern))
        for path in paths:
            tree = ast.parse(path.read_text(encoding="utf-8"))
            of = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
            known = [name for name in names.split() if len(paths) == 1 or name in of or (name == ALL and of)]
            if known:
                yield path.relative_to(ROOT).as_posix(), known, tests


def mutants(file: str, names: list[str], tests: str) -> Iterator[Mutant]:
    """Yield every mutant of the functions and constants of these names; ValueError where there is none of a name."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    for name in names:
        for where, parent in ((node, inner) for node in places(tree, file, name) for inner in ast.walk(node)):
            for field, value in ast.iter_fields(parent):
                if field in ("annotation", "returns", "decorator_list", "ctx", "targets"):
                    continue
                for place, child in enumerate(value if isinstance(value, list) else [value]):
                    for changed in faults(child) if isinstance(child, ast.AST) else ():
                        new = value[:place] + [changed] + value[place + 1 :] if isinstance(value, list) else changed
                        setattr(parent, field, new)
                        of = getattr(where, "name", name)
                        what = f"{file}:{getattr(child, 'lineno', '?')}, {of}: {ast.unparse(child)} -> "
                        source = ast.unparse(ast.fix_missing_locations(tree))
                        yield Mutant(file, what + ast.unparse(changed), source, tests)
                        setattr(parent, field, value)


def copy_to(folder: Path) -> None:
    """Copy the tracked files, as they are now, into `folder`."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, listed.split("\0")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)


def fail(folder: Path, tests: str) -> bool:
    """Tell whether one of the fast ones of these tests fails in a copy, or all of them take too long."""
    environment = os.environ | {"PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    command += [f"tests/{name}" for name in tests.split()]
    try:
        code = subprocess.run(command, cwd=folder, env=environment, capture_output=True, timeout=LIMIT_S).returncode
    except subprocess.TimeoutExpired:
        return True
    assert code >= 0, f"{tests}: pytest was killed by signal {-code}, which says nothing of a mutant"
    return code != 0


def main() -> int:
    """Make the mutants that the command line asks for; return 1 where one survives."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="of a function or file: only these")
    parser.add_argument("--sample", type=int, default=40, help="mutants at random; 0: all (hours)")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    made, survivors = [], 0
    for file, names, tests in chosen():
        made += mutants(file, [one for one in names if not given.names or {one, file} & {*given.names}], tests)
    if given.sample and len(made) > given.sample:
        made = random.Random(given.seed).sample(made, given.sample)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        copy_to(folder)
        if wrong := [tests for tests in sorted({mutant.tests for mutant in made}) if fail(folder, tests)]:
            sys.exit(f"error: these tests fail as the code is: {', '.join(wrong)}")
        for mutant in tqdm(made, unit="mutant"):
            path = folder / mutant.file
            before = path.read_text(encoding="utf-8")
            path.write_text(mutant.source, encoding="utf-8")
            if not fail(folder, mutant.tests):
                survivors += 1
                tqdm.write(f"survives {mutant.tests}: {mutant.what}")
            path.write_text(before, encoding="utf-8")
    print(f"{len(made) - survivors} of {len(made)} mutants were seen")
    return int(survivors > 0)


if __name__ == "__main__":
    sys.exit(main())
