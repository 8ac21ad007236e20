"""An experiment is a thing, not a name: its facts are those of its module, and nothing else is keyed by its name."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from builders.project import CODE, ROOT

from tactile import experiments
from tactile.base import params
from tactile.drawing import labels
from tactile.inference import recordings
from tactile.logs import sources
from tactile.own import settings as own_settings

VALUES = params.load(ROOT / "params.yaml")
NAMES = set(experiments.NAMES)
TEXTS = {path: path.read_text(encoding="utf-8") for path in CODE}
COMPARED, NAMED = 4, 40  # lines


def named(node: ast.expr | None) -> set[str]:
    """The experiment that a key is, or that it begins with."""
    node = node.elts[0] if isinstance(node, ast.Tuple) and node.elts else node
    return {node.value} & NAMES if isinstance(node, ast.Constant) and isinstance(node.value, str) else set()


def keyed(tree: ast.AST) -> Iterator[int]:
    """Lines of what says something for two experiments or more: dictionaries and `match`."""
    for node in ast.walk(tree):
        keys: list[ast.expr | None] = []
        if isinstance(node, ast.Dict):
            keys = node.keys
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "dict":
            keys = [ast.Constant(word.arg) for word in node.keywords]
        elif isinstance(node, ast.Match):
            keys = [case.pattern.value for case in node.cases if isinstance(case.pattern, ast.MatchValue)]
        if len(set().union(*map(named, keys))) > 1:
            yield node.lineno


def compared(tree: ast.AST) -> Iterator[int]:
    """Lines that compare an experiment with its name, or with several."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare) and "experiment" in ast.unparse(node):
            sides = [node.left, *node.comparators]
            inside = [entry for side in sides for entry in getattr(side, "elts", [side])]
            if any(named(entry) for entry in inside):
                yield node.lineno


def found(search) -> list[str]:
    """What a search finds in the code outside the room of experiments."""
    return [
        f"{path.relative_to(ROOT)}, line {line}"
        for path, text in TEXTS.items()
        if path.parent.name != "experiments"
        for line in search(ast.parse(text))
    ]


def test_nothing_is_keyed_by_the_names_of_experiments():
    wrong = found(keyed)
    assert not wrong, f"make these facts of the experiments' modules (tactile/base/facts.py): {wrong}"


def test_few_lines_compare_an_experiment_with_a_name():
    lines = found(compared)
    assert len(lines) <= COMPARED, f"ask for its KIND or for one of its facts: {lines}"


def test_few_lines_name_a_recorded_experiment_outside_its_own_files():
    lines = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path, text in TEXTS.items()
        for line in text.splitlines()
        if any(name in line and path.stem != name for name in experiments.having("source"))
    ]
    assert len(lines) <= NAMED, "\n".join(lines)


@pytest.mark.parametrize(
    "text",
    [
        'x = {"touch": 1, "strain": 2}',
        'x = {"velostat_recorded": 1, "other": 2, "glove_recorded": 3}',
        'x = {("touch", "press"): 1, ("glove", "session"): 2}',
        "x = dict(touch=1, strain=2)",
        'def f(of):\n    return {"strain": 1, "glove": 2}.get(of)',
        'match of:\n    case "touch":\n        pass\n    case "glove":\n        pass',
    ],
)
def test_what_is_keyed_is_seen(text):
    assert list(keyed(ast.parse(text)))


def test_one_experiment_and_other_words_are_no_key():
    assert not list(keyed(ast.parse('x = {"strain": 1, "pressure": 2}\ny = {"touch": 1}\nz = dict(a=1, touch=2)')))


@pytest.mark.parametrize(
    "text",
    ['experiment == "touch"', 'card.experiment != "strain"', '"glove" == experiment', 'experiment in ("glove",)'],
)
def test_a_comparison_is_seen(text):
    assert list(compared(ast.parse(text))) == [1] and not list(compared(ast.parse('area == "strain"')))


def listed(name: str) -> list[str]:
    """The files of a source, two of each row of numbered ones."""
    return [one for path in sources.files(name) for one in sources.members(path)[:2]]


def laid_out(name: str, folder: Path) -> None:
    """Empty files of recordings, placed and called as the experiment's own are."""
    log = experiments.log_name(name)
    for path in [f"{one}/{day}/{log}" for one in "ab" for day in "cd"] if log else listed(name):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).touch()


@pytest.mark.parametrize("name", experiments.NAMES)
def test_predict_finds_the_recordings_that_the_experiment_finds(name, tmp_path):
    """In their folder, and where one of them is named."""
    laid_out(name, tmp_path)
    log = experiments.log_name(name)
    wanted = [path / log if log else path for path in experiments.module(name).recordings(tmp_path)]
    logs = recordings.logs(tmp_path, name)
    assert logs == wanted and len(wanted) > 1
    if wanted[0].is_dir() and not log:  # a recording is the files in it
        of = [[path for path in wanted if path in (tmp_path / file).parents] for file in listed(name)]
        assert all(len(found) == 1 for found in of) and {found[0] for found in of} == set(wanted)
    else:
        called = [log] if log else [Path(path).name for path in listed(name)]  # as is a load cell's log beside one
        assert {path.name for path in wanted} == set(called)
    assert recordings.logs(wanted[0], name) == wanted[:1]


@pytest.mark.parametrize("name", experiments.NAMES)
def test_facts_name_what_there_is(name):
    module, facts, block = experiments.module(name), experiments.facts(name), VALUES[name]
    protocols = set(block["protocols"])
    assert set(facts.compared) <= protocols and {protocol for protocol, _ in facts.tested} <= protocols
    assert facts.metric in ("rmse", "error", "accuracy") and facts.label[0].isupper()
    assert set(facts.quick) <= {*block["models"], *own_settings.YARDSTICKS[module.KIND], own_settings.OF_PRESSES}
    assert all(params.is_optional(f"{name}.{key}") or _has(block, key) for key in (*facts.layout, *facts.sensor))
    assert (facts.source is None) == ("source" in block), "public recordings have no setting that says where logs are"
    if facts.twin:
        assert experiments.facts(facts.twin.experiment).source
    if facts.log:
        assert next(iter(module.formats(block))) == facts.log
        assert all(hasattr(module, each) for each in experiments.OF_OWN)


def _has(block: dict, dotted: str) -> bool:
    for key in dotted.split("."):
        if key not in block:
            return False
        block = block[key]
    return True


@pytest.mark.parametrize("name", ["touch", "glove", "glove_recorded"])
def test_a_condition_has_one_name_for_people(name):
    facts = experiments.facts(name)
    headings = facts.paper.conditions if facts.paper else {}
    for condition, heading in headings.items():
        assert heading == labels.capitalised(labels.task_name(condition))
    for (_, condition), words in facts.tested.items():
        assert words == labels.CONDITIONS.get(condition, words)
    assert {condition for _, condition in facts.tested} & set(labels.CONDITIONS)


def test_a_split_that_ends_in_a_condition_has_its_name():
    assert labels.split_name("session_strain") == "session, bending"
    assert labels.split_name("random_window") == "random window"
    assert labels.place_name("grasp_combined", "combined") == "Grasp, pressure and bending"
    assert labels.place_name("press", "double") == "Press, two touches"
