"""Read the card of a saved model, and hold it against the weights that lie beside it."""

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from pipeline.base import files
from pipeline.base.errors import InputError

Of = TypeVar("Of", bound=BaseModel)  # its field `sha256` is that of the weights


def read(path: Path, kind: type[Of], weights: Path, again: str) -> Of:
    """Return a card; InputError, which ends in `again`, where it is broken or describes other weights."""
    try:
        card = kind.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {again}") from error
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        key = ".".join(map(str, fault["loc"])) or "the file"
        raise InputError(f"{path}, {key}: {fault['msg']}; {again}") from error
    if not weights.is_file() or files.sha256(weights) != card.sha256:
        raise InputError(f"{weights}: is not the file that {path.name} describes; {again}")
    return card
