"""The reports list every place where the code differs from its paper."""

import re

from builders.project import CODE, ROOT

from pipeline.reporting import differences
from tactile.base import params

MARK = "Differs from " + "paper:"
VALUES = params.load(ROOT / "params.yaml")


def test_differences_are_collected(tmp_path):
    (tmp_path / "layer.py").write_text(
        f'"""Text.\n\n{MARK} the sum\nis a mean.\n\nMore. {MARK} in the middle\nof a line.\n"""\n'
        f"x = 1  # {MARK} short.\n# {MARK} two\n# lines.\ny = 2\n"
    )
    found = differences.read(tmp_path, ["layer.py"])
    assert [text for _, text in found] == [
        "the sum is a mean.",
        "in the middle of a line.",
        "short.",
        "two lines.",
    ]
    assert found[0][0] == "layer.py"


def test_every_mark_in_the_code_is_in_a_report():
    marks = {
        file.relative_to(ROOT).as_posix(): len(re.findall(MARK, file.read_text(encoding="utf-8")))
        for file in CODE
        if file.name != "differences.py"  # defines the mark
    }
    listed = {line for name in VALUES["experiments"] for line in differences.of_experiment(name, VALUES[name])}
    counts = {name: sum(file == name for file, _ in listed) for name in marks}
    assert counts == marks and sum(marks.values()) > 15
