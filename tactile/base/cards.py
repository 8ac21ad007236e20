"""Read and write the card of a saved model, which names every file of its package by SHA-256, itself included.

Digests tell a file that was damaged or exchanged. They tell nothing of who made a package: whoever writes one can write
its digests.
"""

import hashlib
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, Protocol, Self, TypeVar

from pydantic import AfterValidator, Field, ValidationError

from tactile.base import files, foreign, params
from tactile.base.errors import InputError
from tactile.settings import Params
from tactile.settings.shared import Block

Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]  # SHA-256
Files = dict[str, Digest]  # by name
TARGET = "target.json"  # the card of a target of one's own
SEEN = "trained on this recording: no test"
VALIDATED = "this recording is of the validation part: no test"
NO_TEST = (SEEN, VALIDATED)  # reasons why a recording with a truth is not scored
UNKNOWN = (
    "the model's card does not say which logs it was trained on; the scores of a log that was one of them are no test"
)
LARGEST = 64 << 20  # bytes; the card of an array of 256 x 256 elements has 7 million
LONGEST = 1000  # characters of a text


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("has characters that cannot be printed")
    return text


Words = Annotated[str, Field(max_length=LONGEST), AfterValidator(_printable)]  # they reach a terminal


class Card(Protocol):
    """A class of pydantic with a field `files`."""

    @property
    def files(self) -> Files: ...
    def model_copy(self, *, update: Mapping[str, Any]) -> Self: ...
    def model_dump_json(self, *, indent: int, **dumped: Any) -> str: ...
    @classmethod
    def model_validate_json(cls, text: str, /, *, strict: bool) -> Self: ...


Of = TypeVar("Of", bound=Card)


def write(path: Path, card: Card, **dumped: Any) -> None:
    """Write a card, with its own digest among its `files`; dumped: as of `model_dump_json`."""
    whole = card.model_copy(update={"files": {**card.files, path.name: ""}})
    files.write_text(path, sealed(whole.model_dump_json(indent=1, **dumped) + "\n", path.name))


def sealed(text: str, name: str) -> str:
    """Return the text of a card in which its own digest is that of the text without it; name: of its file."""
    empty = re.sub(_seal(name), r'\1""', text.replace("\r\n", "\n"), count=1)  # Git may change line ends
    digest = hashlib.sha256(empty.encode()).hexdigest()
    return re.sub(_seal(name), rf'\1"{digest}"', empty, count=1)


def _seal(name: str) -> str:
    """Return the pattern of a card's own digest."""
    return rf'("{re.escape(name)}": ?)"[0-9a-f]*"'


def read(path: Path, kind: type[Of], package: Collection[str], again: str) -> Of:
    """Return a card, whose files lie beside it as it names them; package: names that a file of it may have.

    Raises InputError, which ends in `again`, where the card is broken or no longer as it was written, and where a file
    is missing, another one, or not named. Other files in the folder are read by nothing, and may lie there.
    """
    card, text = parsed(path, kind, again)
    if wrong := faults(path, card, text, package):
        raise InputError(f"{next(iter(wrong.values()))}; {again}")
    return card


def parsed(path: Path, kind: type[Of], again: str) -> tuple[Of, str]:
    """Return a card and its text; InputError, which ends in `again`, where it is broken. No digest is looked at."""
    with foreign.reading(path, "a card of a model", again, LARGEST):
        text = path.read_bytes().decode("utf-8")
        try:
            return kind.model_validate_json(text, strict=True), text
        except ValidationError as error:
            found = error.errors(include_url=False, include_input=False)
    if {(("files",), "missing"), (("sha256",), "extra_forbidden")} <= {
        (fault["loc"], fault["type"]) for fault in found
    }:
        raise InputError(f"{path}: is of a version that named one file by its digest, and not every one; {again}")
    key = ".".join(map(str, found[0]["loc"])) or "the file"
    raise InputError(f"{path}, {key}: {found[0]['msg']}; {again}")


def faults(path: Path, card: Card, text: str, package: Collection[str]) -> dict[str, str]:
    """Return what is wrong with the files of a package, a sentence by name; arguments as of `read` and `parsed`."""
    named, wrong = dict(card.files), {}
    if named.pop(path.name, None) is None:
        wrong[path.name] = f"{path}, files: does not name {path.name} itself"
    elif sealed(text, path.name) != text.replace("\r\n", "\n"):
        wrong[path.name] = f"{path}: is not as it was written, by its own digest"
    for name in sorted({*named, *package}):
        file = path.with_name(name) if name in package else path
        if name not in package:
            wrong[name] = f"{path}, files: names '{name}', which is no file of a package"
        elif name not in named and (file.exists() or file.is_symlink()):
            wrong[name] = f"{file}: is not among the files that {path.name} names"
        elif name in named and not file.is_file():
            wrong[name] = f"{file}: not found, but {path.name} names it"
        elif name in named and digest(file) != named[name]:
            wrong[name] = f"{file}: is not the file that {path.name} describes"
    return wrong


def digest(path: Path) -> str:
    """Return the digest of a file; InputError where it cannot be read."""
    with foreign.reading(path, "a file that can be read", "copy it again"):
        return files.sha256(path)


def check_blocks(path: Path, key: str, experiment: str, blocks: Mapping, names: tuple[str, ...], again: str) -> None:
    """Raise InputError unless `blocks` are those of `names` that the settings of an experiment have, each as it asks.

    path, key: of the card and of the blocks in it.
    """
    of: type[Block] = params.kind_at(Params, [experiment])[0]
    wanted = [name for name in names if name in of.model_fields]
    if set(blocks) != set(wanted):
        raise InputError(f"{path}, {key}: of {experiment} it has the blocks {', '.join(wanted)} and no other; {again}")
    for name in wanted:
        check_block(path, f"{key}.{name}", blocks[name], params.kind_at(of, [name])[0], again)


def check_block(path: Path, key: str, block: Mapping, kind: type[Block], again: str) -> None:
    """Raise InputError where a block of a card is not one of this kind; arguments as of `check_blocks`."""
    try:
        params.check_block(block, kind, key, {key: str(path)})
    except InputError as error:
        raise InputError(f"{error}; {again}") from error
