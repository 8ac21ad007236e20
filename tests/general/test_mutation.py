"""The faults that benchmarks/mutation.py puts into code are faults: a test that compares numbers sees each kind."""

import ast

import numpy as np
import pytest

from benchmarks import mutation

EXAMPLE = """
import numpy as np

def centred(x, mean, spread):
    return (x - mean) / spread

def filtered(x, mean, spread, share=0.5):
    seen, state = [], 0.0
    for row in centred(x, mean, spread):
        state = share * state + row
        seen.append(state)
    return np.array(seen)

def answer(x, mean, spread):
    return filtered(x, mean, spread, share=0.9)
"""
X, MEAN, SPREAD = np.arange(12.0).reshape(4, 3) ** 2, np.arange(4.0)[:, None], np.arange(3.0, 7.0)[:, None]
CALL = "answer: filtered(x, mean, spread, share=0.9) -> "
KINDS = {  # of a fault -> what it makes of the example
    "left out": f"{CALL}filtered(x, mean, spread)",
    "taken from its neighbour": f"{CALL}filtered(mean, mean, spread, share=0.9)",
    "the last from the one before": f"{CALL}filtered(x, mean, mean, share=0.9)",
    "time reversed": f"{CALL}filtered(x[::-1], mean, spread, share=0.9)",
    "broadcast of the first": "centred: x - mean -> x - mean[:1]",
}


@pytest.fixture
def made(tmp_path, monkeypatch) -> dict[str, str]:
    """Return what each mutant of the example changes, without its line -> its source."""
    (tmp_path / "pipeline").mkdir()
    (tmp_path / "pipeline" / "example.py").write_text(EXAMPLE)
    monkeypatch.setattr(mutation, "ROOT", tmp_path)
    monkeypatch.setattr(mutation, "CHOSEN", {"pipeline/ex*.py": ("*", "none")})
    ((file, names, tests),) = mutation.chosen()
    return {each.what.partition(", ")[2]: each.source for each in mutation.mutants(file, names, tests)}


def said(source: str) -> np.ndarray | None:
    """Return the answer of a source; None where it breaks off."""
    names = {}
    exec(source, names)
    try:
        with np.errstate(all="ignore"):
            return names["answer"](X, MEAN, SPREAD)
    except (TypeError, ValueError, IndexError):
        return None


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_of_each_kind_is_made_and_changes_the_answer(kind, made):
    right, wrong = said(EXAMPLE), said(made[KINDS[kind]])
    assert wrong is None or wrong.shape != right.shape or not np.allclose(wrong, right, equal_nan=True)


def test_each_mutant_has_one_fault(made):
    whole = ast.unparse(ast.parse(EXAMPLE)).splitlines()
    for what, source in made.items():
        lines = zip(source.splitlines(), whole, strict=True)
        assert sum(one != other for one, other in lines) == 1, what
    assert {what.partition(":")[0] for what in made} == {"centred", "filtered", "answer"}
