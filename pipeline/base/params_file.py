"""Set values in a file of settings; all other settings and the comments stay."""

from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from pipeline.base import files, params
from pipeline.base.errors import InputError


def set_values(values: dict, params_file: Path, source: str = "params.yaml") -> None:
    """Set the values of dotted keys (`touch.window.stride`) in a params file; InputError for an unknown key.

    A key that the file lacks is set where it is optional. `source`: the file that the values are from, which a sentence
    about an unknown key names; params.load names it for a wrong value.
    """
    editor = YAML()
    editor.width = 4096  # never wrap a line
    editor.representer.add_representer(float, _float)
    content = editor.load(params_file.read_text(encoding="utf-8"))
    for name, value in values.items():
        dotted = str(name)
        *path, last = dotted.split(".")
        block = content
        for key in [*path, last]:
            known = isinstance(block, dict) and (key in block or (key == last and params.is_optional(dotted)))
            if not known:
                hint = params.hint(key, block) if isinstance(block, dict) else "name a setting"
                raise InputError(f"{source}: there is no key '{dotted}'; {hint}")
            parent, block = block, block.get(key)
        parent[last] = _flow(value)
    with files.replacing(params_file) as draft, open(draft, "w", encoding="utf-8") as file:
        editor.dump(content, file)


def _float(representer, value: float):
    """Write 1e-06 as 1.0e-06: without a point YAML readers take the number for text."""
    text = repr(value)
    text = text if "." in text else text.replace("e", ".0e")
    return representer.represent_scalar("tag:yaml.org,2002:float", text)


def _flow(value):
    """Put lists and blocks on one line, as in the rest of params.yaml."""
    if isinstance(value, list):
        sequence = CommentedSeq(value)
        sequence.fa.set_flow_style()
        return sequence
    if isinstance(value, dict):
        block = CommentedMap({key: _flow(item) for key, item in value.items()})
        block.fa.set_flow_style()
        return block
    return value
