"""SECURITY.md promises nothing that no test holds."""

import ast
import re

from builders.project import ROOT

ROW = re.compile(r"^\| .+ \| .+ \| `(tests/\S+\.py)::(test_\w+)` \|$")


def test_every_promise_names_a_test_that_there_is():
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("|")][2:]
    assert len(rows) > 20
    for row in rows:
        found = ROW.match(row)
        assert found, f"no test behind: {row}"
        tree = ast.parse((ROOT / found[1]).read_text(encoding="utf-8"))
        assert any(isinstance(node, ast.FunctionDef) and node.name == found[2] for node in tree.body), row


def test_the_readme_leads_there():
    assert "(SECURITY.md)" in (ROOT / "README.md").read_text(encoding="utf-8")
