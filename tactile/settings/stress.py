"""Settings of the stress tests: what goes wrong after training, and how badly. Severity 0 is always done.

Which tests there are is read in the code of the functions that are registered as such, see base/stress_tests.py.
"""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from pydantic import AfterValidator, Field, create_model, model_validator

from tactile.settings.shared import Block, Distinct, Number, Positive, SomeOf, Text


def without_zero(severities: list[float]) -> list[float]:
    """Return the severities; ValueError where 0 is among them."""
    if 0 in severities:
        raise ValueError("should not list severity 0, which is always done")
    return severities


Severities = Annotated[Distinct[Number], AfterValidator(without_zero)]
Severity = Annotated[Number, AfterValidator(lambda severity: without_zero([severity])[0])]


class Declared(NamedTuple):
    """What the code of a stress test says of it."""

    unit: str  # of the severity, in words
    meaning: str  # first line of the docstring


def declared(path: Path) -> Iterator[tuple[str, str, Declared]]:
    """Yield (kind of input or experiment of a scene, name, Declared) of a file's functions under `@stress_test(...)`.

    Python runs none of it: its imports would cost every stage 1 s. Raises TypeError that names the function where an
    argument is not written out.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for function in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
        for call in function.decorator_list:
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "stress_test":
                try:
                    of = [ast.literal_eval(each) for each in call.args]
                    (unit,) = (ast.literal_eval(each.value) for each in call.keywords if each.arg == "unit")
                except ValueError as error:
                    where = f"pipeline/{path.parent.name}/{path.name}, {function.name}"
                    raise TypeError(f"{where}: give @stress_test a unit and write out its arguments as text") from error
                meaning = (ast.get_docstring(function) or "").partition("\n")[0]
                yield from ((each, function.name, Declared(unit, meaning)) for each in of)


REPRODUCTION = Path(__file__).resolve().parents[2] / "pipeline"  # which an installed wheel has not
TESTS = [
    one
    for files in ("stability/*.py", "scenes/*_stress.py")
    for path in REPRODUCTION.glob(files)
    for one in declared(path)
]


def severities(kind_of: Any, name: str, *of: str) -> type[SomeOf]:
    """Return a class of severities by stress test: of the readings of a kind of input, and of an experiment's scene.

    kind_of: `Severities`, or `Severity` where a test has one; name: of the class, after that of the last of `of`.
    """
    fields: dict[str, Any] = {
        test_name: (kind_of, Field(default=None, description=f"{test.meaning} Severity: {test.unit}"))
        for kind, test_name, test in sorted(TESTS)
        if kind in of
    }
    return create_model(f"{of[-1].capitalize()}{name}", __base__=SomeOf, __doc__="Severities by test.", **fields)


class Tested(Block):
    """What is tested of an experiment."""

    protocols: Distinct[Text] = Field(description="Protocols whose trained models are tested")
    usable: dict[Text, Positive] = Field(
        description="Largest error at which a model is still usable, by protocol, in the unit of the experiment's "
        "error; of one condition of a protocol, `protocol/condition`"
    )
    recordings: dict[Text, Annotated[int, Field(ge=1, le=100_000)]] = Field(
        default={}, description="Of windows: how many recordings of a condition, the first, are perturbed"
    )

    @model_validator(mode="after")
    def _usable_for_each(self) -> "Tested":
        of_conditions = {name for name in self.usable if name.partition("/")[0] in self.protocols and "/" in name}
        if set(self.usable) - of_conditions != set(self.protocols):
            raise ValueError(f"usable should have these keys: {', '.join(self.protocols)}")
        return self


def tested(span: str, *of: str) -> type[Tested]:
    """Return the class of what is tested of one experiment; of: as of `severities`, span: the range of its readings."""
    whole, one = severities(Severities, "StressTests", *of), severities(Severity, "SmokeTests", *of)
    perturbations = whole, Field(description=f"Severities by what goes wrong, of the evidence; range: {span}")
    look = one, Field(description="What `dvc repro` tests: that stress tests run, not where models fail")
    return create_model("Stress", __base__=Tested, __doc__="What is tested.", perturbations=perturbations, look=look)


if TYPE_CHECKING:  # which fields it has is known when it runs
    Stress = Block
elif not TESTS:  # nothing reads these settings there
    Stress = dict[Text, Any]
else:
    Stress = create_model(
        "Stress",
        __base__=Block,
        __doc__="What is tested of each experiment.",
        touch=(tested("the ADC's 1023 counts", "windows", "touch"), Field(description="Stress tests of touch")),
        velostat_recorded=(
            tested("of training readings", "windows"),
            Field(description="Stress tests of velostat_recorded"),
        ),
        array_recorded=(tested("of training readings", "windows"), Field(description="Stress tests of array_recorded")),
        strain=(tested("each channel's", "series", "strain"), Field(description="Stress tests of strain")),
        strain_recorded=(tested("each channel's", "series"), Field(description="Stress tests of strain_recorded")),
        glove=(tested("each area's", "images", "glove"), Field(description="Stress tests of glove")),
        glove_recorded=(tested("each area's", "images"), Field(description="Stress tests of glove_recorded")),
    )
