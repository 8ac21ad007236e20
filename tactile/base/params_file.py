"""Copy the files of settings, and set values in them; all other settings and the comments stay."""

import shutil
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.nodes import ScalarNode
from ruamel.yaml.representer import RoundTripRepresenter
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from tactile.base import files, foreign, params
from tactile.base.errors import InputError


def copied(file: Path, folder: Path) -> Path:
    """Copy a params.yaml and the params/ beside it (params.settings_files) to a folder, in place of its own.

    Return the copy of params.yaml.
    """
    found = params.settings_files(file)
    for former in (folder / "params").glob("*.yaml"):
        former.unlink()
    for one in found:
        target = folder / one.relative_to(found[0].parent)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(one, target)
    return folder / file.name


def set_values(values: dict, params_file: Path, source: str = "params.yaml") -> None:
    """Set the values of dotted keys (`touch.window.stride`) in params.yaml, or the file in params/ that has the block.

    Raises InputError for an unknown key, and where there is no params.yaml. A key that a file lacks is set where it is
    optional. `source`: the file that the values are from, which a sentence about an unknown key names; params.load
    names it for a wrong value.
    """
    if not params_file.is_file():
        raise InputError(f"{params_file}: not found; only a copy of the settings can be changed")
    editor = YAML()
    editor.width = 4096  # never wrap a line
    editor.representer.add_representer(float, _float)
    found = {file: params.parsed(file) for file in params.settings_files(params_file)}
    changed = {}  # what is edited takes ten times as long to read, so no other file is
    for name, value in values.items():
        dotted = str(name)
        *above, last = dotted.split(".")
        file = next((file for file, blocks in found.items() if dotted.partition(".")[0] in blocks), params_file)
        if file not in changed:
            with foreign.reading(params.name_of(file), "valid YAML", "fix it"):
                changed[file] = editor.load(file.read_text(encoding="utf-8"))
        block = whole = changed[file]
        for depth, key in enumerate([*above, last]):
            path = ".".join([*above, last][: depth + 1])
            optional = isinstance(block, dict) and params.is_optional(path)
            if optional and key not in block and path != dotted:
                inside = ", ".join(f"{name}: ..." for name in params.keys(path))
                raise InputError(
                    f"{source}: there is no '{path}' in which '{dotted.removeprefix(f'{path}.')}' could be set; write "
                    f"all of it, `{path}: {{{inside}}}`"
                )
            if not (isinstance(block, dict) and (key in block or optional)):
                near = [key for blocks in found.values() for key in blocks] if block is whole else block
                above_it = path.rpartition(".")[0]
                further = [name for name in params.keys(above_it) if params.is_optional(f"{above_it}.{name}")]
                hint = (
                    params.hint(key, dict.fromkeys([*near, *further])) if isinstance(block, dict) else "name a setting"
                )
                raise InputError(f"{source}: there is no key '{dotted}'; {hint}")
            parent, block = block, block.get(key)
        parent[last] = _flow(value)
    for edited, content in changed.items():
        with files.replacing(edited) as draft, open(draft, "w", encoding="utf-8") as stream:
            editor.dump(content, stream)


def _float(representer: RoundTripRepresenter, value: float) -> ScalarNode:
    """Write 1e-06 as 1.0e-06: without a point YAML readers take the number for text."""
    text = repr(value)
    text = text if "." in text else text.replace("e", ".0e")
    return representer.represent_scalar("tag:yaml.org,2002:float", text)


def _flow(value: object) -> object:
    """Put lists and blocks on one line, as in the rest of the file."""
    if isinstance(value, str) and "?" in value:  # which ends a text in a list for the parser in C
        return DoubleQuotedScalarString(value)
    if isinstance(value, list):
        sequence = CommentedSeq([_flow(item) for item in value])
        sequence.fa.set_flow_style()
        return sequence
    if isinstance(value, dict):
        block = CommentedMap({key: _flow(item) for key, item in value.items()})
        block.fa.set_flow_style()
        return block
    return value
