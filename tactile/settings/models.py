"""The settings of the models, a block per model: `Models` is any of them, by their keys.

Each is declared at the head of the model's file in tactile/models, as a class `Settings`. Python runs that class with
its imports of `MADE_OF`, and not the rest of the file: imports of torch and scikit-learn would cost every stage 3 s.
"""

import ast
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from tactile.settings.shared import Block, SomeOf

FOLDER = Path(__file__).resolve().parents[1] / "models"
MADE_OF = ("math", "typing", "pydantic", "tactile.settings.shared", "tactile.settings.training")


def declared(path: Path) -> tuple[type[Block], str]:
    """Return the class `Settings` of a model's file and what the first line of its docstring says of the model.

    Raises TypeError where the file has no such class, or one that Python cannot make of `MADE_OF` alone.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    head: list[ast.stmt] = [
        node
        for node in tree.body
        if (isinstance(node, ast.ImportFrom) and node.module in MADE_OF)
        or (isinstance(node, ast.ClassDef) and node.name == "Settings")
    ]
    names: dict[str, Any] = {"__name__": f"tactile.models.{path.stem}"}
    try:
        exec(compile(ast.Module(head, []), path, "exec"), names)
    except Exception as error:  # whatever a class body can raise
        raise TypeError(
            f"tactile/models/{path.name}: its class Settings cannot be made ({error}); describe every setting as "
            f"`name: kind = Field(description=...)`, of names imported from {', '.join(MADE_OF)}"
        ) from error
    if "Settings" not in names:
        raise TypeError(f"tactile/models/{path.name}: declare its settings as `class Settings(Block)`")
    return names["Settings"], (ast.get_docstring(tree) or "").partition("\n")[0]


def fields(folder: Path) -> dict:
    """Return key -> (settings, field) of every model of a folder, each of which may be absent."""
    found = {path.stem: declared(path) for path in sorted(folder.glob("*.py")) if path.stem != "__init__"}
    return {key: (settings, Field(default=None, description=meaning)) for key, (settings, meaning) in found.items()}


if TYPE_CHECKING:  # which fields it has is known when it runs
    Models = SomeOf
else:
    Models = create_model("Models", __base__=SomeOf, __doc__="The models to train, by their keys.", **fields(FOLDER))
