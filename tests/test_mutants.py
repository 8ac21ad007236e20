"""The list of mutants keeps up with the code: `python tests/mutants.py` itself is run by hand."""

import ast
from pathlib import Path

import mutants
import pytest

TESTS = Path(__file__).resolve().parent


@pytest.mark.parametrize("mutant", mutants.MUTANTS, ids=lambda mutant: mutant.name)
def test_a_mutant_changes_one_place_and_names_its_tests(mutant):
    source = (mutants.ROOT / mutant.file).read_text()
    assert source.count(mutant.text) == 1 and mutant.fault != mutant.text
    if mutant.file.endswith(".py"):
        ast.parse(source.replace(mutant.text, mutant.fault))  # a fault, not a typing error
    for test in mutant.tests.split():
        file, _, name = test.partition("::")
        assert f"def {name.split('[')[0]}" in (TESTS / file).read_text()


def test_names_are_unique_and_the_list_is_long():
    mutants.check(mutants.MUTANTS)
    assert len({mutant.name for mutant in mutants.MUTANTS}) == len(mutants.MUTANTS) >= 60


def test_a_mutant_that_is_out_of_date_is_named():
    gone = mutants.MUTANTS[0]._replace(name="gone", text="no such text")
    with pytest.raises(mutants.Wrong, match="gone: its text occurs 0 times in pipeline/tasks/windows.py, not once"):
        mutants.check([gone])
    with pytest.raises(mutants.Wrong, match="two mutants are called gone"):
        mutants.check([gone, gone])
    with pytest.raises(mutants.Wrong, match="there is no mutant gone"):
        mutants.chosen(["gone"])
