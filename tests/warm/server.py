"""Run `python -m` in forks of one process that has imported the libraries: imports are half the cost of a small stage.

    python tests/warm/server.py SOCKET

It ends with its standard input. The program `python` beside this file hands a command over. Nothing of the pipeline is
imported before the fork, so that each stage reads and notes what it would in a process of its own.
"""

import array
import atexit
import contextlib
import importlib
import json
import os
import runpy
import select
import socket
import sys
import threading
import traceback
from collections.abc import Callable
from typing import NoReturn

LIBRARIES = """
jinja2 markdown_it matplotlib.pyplot mlflow.models mlflow.pyfunc mlflow.tracking numba onnx onnxruntime
onnxscript.optimizer pandas pyarrow.compute pyarrow.csv pyarrow.parquet pydantic ruamel.yaml safetensors.torch
scipy.fft scipy.io scipy.ndimage scipy.optimize scipy.signal scipy.special scipy.stats skops.io sklearn.cluster
sklearn.decomposition sklearn.dummy sklearn.ensemble sklearn.linear_model sklearn.metrics sklearn.naive_bayes
sklearn.pipeline sklearn.preprocessing sklearn.tree sqlalchemy torch torch._dynamo torch.export
torch.onnx._internal.exporter._core tqdm yaml
""".split()


def receive(connection: socket.socket) -> tuple[dict, list[int]]:
    """Return what a client wants run (argv, folder, environment), and its three standard streams."""
    streams = array.array("i")
    text, ancillary, *_ = connection.recvmsg(1 << 20, socket.CMSG_SPACE(3 * streams.itemsize))
    streams.frombytes(ancillary[0][2])
    while not text.endswith(b"\n"):
        text += connection.recv(1 << 20)
    return json.loads(text), list(streams)


def become(wanted: dict, streams: list[int]) -> None:
    """Make this fork what `python -m MODULE ...` would have started, and run the module to its end."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    # Anew: whether a stream can seek was noted of the one before.
    sys.stdin = sys.__stdin__ = open(0, closefd=False)
    sys.stdout = sys.__stdout__ = open(1, "w", closefd=False)
    sys.stderr = sys.__stderr__ = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)
    os.chdir(wanted["folder"])
    os.environ.clear()
    os.environ.update(wanted["environment"])
    _, module, *arguments = wanted["argv"]
    sys.orig_argv[:] = [sys.executable, *wanted["argv"]]
    sys.argv[:] = [module, *arguments]
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:] = [os.getcwd(), *filter(None, paths), *sys.path[1:]]
    importlib.invalidate_caches()
    with contextlib.suppress(ModuleNotFoundError):
        importlib.import_module("sitecustomize")
    runpy.run_module(module, run_name="__main__", alter_sys=True)


def end_as_python(run: Callable[[], None]) -> NoReturn:
    """End this process as Python would end after `run`, but for what the imported libraries do at their end."""
    atexit._clear()
    code = 0
    try:
        run()
    except SystemExit as ended:
        code = ended.code
        if not isinstance(code, int | None):
            print(code, file=sys.stderr)
            code = 1
    except BaseException:
        traceback.print_exc()
        code = 1
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code or 0)


def serve(connection: socket.socket) -> NoReturn:
    """Run one command in a fork, and tell the client its exit status; as long as it runs, so does this process."""
    wanted, streams = receive(connection)
    child = os.fork()
    if not child:
        connection.close()
        end_as_python(lambda: become(wanted, streams))
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    connection.sendall(b"%d\n" % (code if code >= 0 else 128 - code))
    os._exit(0)


def main() -> None:
    """Import the libraries, then serve until standard input ends."""
    for library in LIBRARIES:
        importlib.import_module(library)
    assert threading.active_count() == 1, "a fork has no other thread"
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(sys.argv[1])
    listening.listen()
    while True:
        ready, _, _ = select.select([listening, sys.stdin], [], [])
        if sys.stdin in ready:
            break
        connection, _ = listening.accept()
        if not os.fork():
            listening.close()
            serve(connection)
        connection.close()
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
    with contextlib.suppress(ChildProcessError):
        while True:
            os.wait()


if __name__ == "__main__":
    main()
