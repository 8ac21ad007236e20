"""Note which settings of params.yaml the stages read.

`sitecustomize.py` beside this file starts it: with this folder in PYTHONPATH, every `python -m <stage>`, and
every process of studies, adds the dotted paths of the settings that it has read to the file that the variable
SETTINGS_READ names.
"""

import atexit
import json
import os
import re
import sys
from collections.abc import Callable

# Stages that keep books on all settings, whether or not anything reads them.
BOOKKEEPERS = ("pipeline.stages.track",)
STAGE = re.compile(r"(tactile|pipeline)\.(stages|studies)\.")


class Noted(dict):
    """A block of settings that adds the dotted path of each one that is read to the set `read`.

    What is laid over it with `|` has no path. A copy made by `dict` is a plain one, of blocks that go on noting.
    """

    def __init__(self, block: dict, read: set[str], path: str = ""):
        self.read, self.paths = read, {key: f"{path}{key}" for key in block}
        super().__init__(
            (key, Noted(value, read, f"{path}{key}.") if isinstance(value, dict) else value)
            for key, value in block.items()
        )

    def __getitem__(self, key):
        if key in self.paths:
            self.read.add(self.paths[key])
        return super().__getitem__(key)

    def get(self, key, default=None):
        return self[key] if key in self else default

    def items(self):
        return [(key, self[key]) for key in self]

    def values(self):
        return [self[key] for key in self]

    def __or__(self, other: dict):
        merged = Noted({}, self.read)
        merged.update(self)
        merged.update(other)
        merged.paths = {key: path for key, path in self.paths.items() if key not in other}
        return merged

    def __reduce__(self):
        return dict, (plain(self),)


def plain(value):
    """The value without notes: its settings are not read by this."""
    return {key: plain(own) for key, own in dict.items(value)} if isinstance(value, dict) else value


def ignore_bookkeeping(replace: Callable) -> None:
    """To check settings, or to write them down, is not to read them; replace: `setattr`, or one that is undone."""
    from tactile.base import params

    check_block, dumps = params.check_block, json.dumps
    replace(params, "check_block", lambda given, *others: check_block(plain(given), *others))
    replace(json, "dumps", lambda value, *others, **how: dumps(plain(value), *others, **how))


def main() -> None:
    """Note what the stage reads that this process was started for."""
    command = dict(zip(sys.orig_argv, sys.orig_argv[1:], strict=False)).get("-m", "")
    several = any(map(STAGE.match, sys.orig_argv))  # by `Project.stages`
    if not (command.startswith(("pipeline.", "tactile.")) or several) or command in BOOKKEEPERS:
        return
    from tactile.base import params

    load, read = params.load, set()
    params.load = lambda *arguments: Noted(load(*arguments), read)
    ignore_bookkeeping(setattr)

    def write() -> None:
        with open(os.environ["SETTINGS_READ"], "a", encoding="utf-8") as file:
            file.write("".join(f"{path}\n" for path in sorted(read)))

    atexit.register(write)
