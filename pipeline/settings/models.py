"""The settings of the models, a block per model: `Models` is any of them, by their keys.

Each is declared at the head of the model's file in pipeline/models, as a class `Settings`. That class is read and the
rest of the file is not run: imports of torch and scikit-learn would cost every stage 3 s.
"""

import ast
from pathlib import Path
from typing import Literal

from pydantic import Field, create_model

from pipeline.settings import shared, training
from pipeline.settings.shared import Block, SomeOf

FOLDER = Path(__file__).resolve().parents[1] / "models"
KINDS = {"Literal": Literal, "bool": bool, "float": float, "int": int, "str": str} | vars(shared) | vars(training)


def declared(path: Path) -> tuple[type[Block], str]:
    """Return the class `Settings` of a model's file and what the first line of its docstring says of the model.

    Raises TypeError where the file has no such class, or one that says more than kinds and fields.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "Settings"]
    if not classes:
        raise TypeError(f"pipeline/models/{path.name}: declare its settings as `class Settings(Block)`")
    (found,) = classes
    declared_fields = {
        node.target.id: (_kind(node.annotation, path), _field(node.value, path))
        for node in found.body
        if isinstance(node, ast.AnnAssign)
    }
    module, words = f"pipeline.models.{path.stem}", ast.get_docstring(found)
    settings = create_model("Settings", __base__=Block, __module__=module, __doc__=words, **declared_fields)
    return settings, (ast.get_docstring(tree) or "").partition("\n")[0]


def _kind(node: ast.expr, path: Path):
    """Return the kind of a setting that an annotation names: of KINDS, or such a one with others in brackets."""
    if isinstance(node, ast.Subscript):
        inside = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        kinds = tuple(each.value if isinstance(each, ast.Constant) else _kind(each, path) for each in inside)
        return _kind(node.value, path)[kinds if len(kinds) > 1 else kinds[0]]
    name = node.id if isinstance(node, ast.Name) else ""
    if name not in KINDS:
        raise TypeError(
            f"pipeline/models/{path.name}: '{ast.unparse(node)}' is no kind of setting; use one of "
            "pipeline/settings/shared.py or training.py, int, float, bool, str or Literal"
        )
    return KINDS[name]


def _field(node: ast.expr | None, path: Path):
    """Return the Field of a setting, whose arguments are constants."""
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Field"):
        raise TypeError(f"pipeline/models/{path.name}: describe every setting as `name: kind = Field(description=...)`")
    return Field(**{word.arg: ast.literal_eval(word.value) for word in node.keywords})


def fields(folder: Path) -> dict:
    """Return key -> (settings, field) of every model of a folder, each of which may be absent."""
    found = {path.stem: declared(path) for path in sorted(folder.glob("*.py")) if path.stem != "__init__"}
    return {key: (settings, Field(default=None, description=meaning)) for key, (settings, meaning) in found.items()}


Models = create_model("Models", __base__=SomeOf, __doc__="The models to train, by their keys.", **fields(FOLDER))
