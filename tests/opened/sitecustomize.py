"""Note which files of a project each of its DVC stages opens. Python imports this file at its start, where it is found.

With the folder of this file in PYTHONPATH, every process of a stage writes a file `<stage>.<process id>` to the folder
that the variable OPENED names: a line `<read, list or write> <path below the project>` for everything that it opens,
lists or renames. Python itself tells of that (its audit events `open`, `os.listdir`, `os.scandir` and `os.rename`). It
cannot tell of files that compiled code opens, which here are Parquet and safetensors files: the functions in NATIVE do
so and are wrapped. Nothing is noted where a file is only asked for (`Path.exists`).
"""

import importlib.util
import os
import sys

NATIVE = {  # module -> function of it -> how it opens the file that it is given
    "pyarrow.parquet": {"read_table": "read", "ParquetWriter": "write"},
    "safetensors.torch": {"load_file": "read", "save_file": "write"},
}


class Notes:
    """The file of this process, with every line once."""

    def __init__(self, folder: str, stage: str):
        self.root = os.getcwd() + os.sep
        name = os.path.join(folder, f"{stage}.{os.getpid()}")
        self.handle = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        self.known = set()

    def add(self, how: str, path) -> None:
        """Note a file of the project, given as whatever Python takes for a path."""
        if not isinstance(path, (str, bytes, os.PathLike)):
            return  # a file that is open already
        path = os.path.abspath(os.fsdecode(path))
        line = f"{how} {path.removeprefix(self.root)}\n"
        if how != "write" and not os.path.exists(path):
            return  # as where a folder is removed, whose files are named without it
        if path.startswith(self.root) and line not in self.known:
            self.known.add(line)
            os.write(self.handle, line.encode(errors="surrogateescape"))

    def hear(self, event: str, arguments: tuple) -> None:
        """Python's audit events."""
        if event == "open":
            if arguments[2] & getattr(os, "O_DIRECTORY", 0):
                return  # a folder whose names the disk is to have; who reads names lists them
            writes = arguments[2] & (os.O_WRONLY | os.O_RDWR)
            self.add("write" if writes else "read", arguments[0])
        elif event in ("os.listdir", "os.scandir"):
            self.add("list", arguments[0])
        elif event == "os.rename":
            self.add("write", arguments[1])

    def wrapped(self, function, how: str):
        """`function`, whose first argument is the file (of save_file: the second), noting it."""

        def noting(*arguments, **options):
            self.add(how, arguments[function.__name__ == "save_file"])
            return function(*arguments, **options)

        return noting


class Finder:
    """Imports the modules in NATIVE with their functions wrapped."""

    def __init__(self, notes: Notes):
        self.notes = notes
        self.busy = False

    def find_spec(self, name: str, path=None, target=None):
        """As Python asks every finder, first this one."""
        if name not in NATIVE or self.busy:
            return None
        self.busy = True
        spec = importlib.util.find_spec(name)
        self.busy = False
        run = spec.loader.exec_module

        def exec_module(module) -> None:
            run(module)
            self.wrap(module)

        spec.loader.exec_module = exec_module
        return spec

    def wrap(self, module) -> None:
        """Wrap the functions of one of NATIVE."""
        for function, how in NATIVE[module.__name__].items():
            setattr(module, function, self.notes.wrapped(getattr(module, function), how))


if os.environ.get("SETTINGS_READ"):
    import noted

    noted.main()  # first: what it imports is not the stage's doing

if os.environ.get("OPENED") and os.environ.get("DVC_STAGE"):
    notes = Notes(os.environ["OPENED"], os.environ["DVC_STAGE"])
    finder = Finder(notes)
    sys.addaudithook(notes.hear)
    sys.meta_path.insert(0, finder)
    for name in NATIVE:
        if name in sys.modules:  # in a fork of warm/server.py
            finder.wrap(sys.modules[name])
