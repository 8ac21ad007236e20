"""Fill MLflow's store with the committed evidence, and print the links that compare the models.

It computes nothing, takes half a minute the first time, and adds nothing when it is called again. Where `dvc repro` was
run, which ends with it, each of its trainings is a run, too. The store is `mlflow.db`, where `mlflow ui` finds it, or
the server or database that MLFLOW_TRACKING_URI names. With --serve, MLflow's pages are then served to this machine
alone until Ctrl-C, and a browser opens the first comparison.

Examples:

    tactile track
    tactile track --serve
"""

import argparse
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import webbrowser
from urllib.parse import urlsplit

from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

LONGEST_START_S = 120.0  # of MLflow's server; 5 to 20 s on an idle core
STOP_S = 10.0  # until a server that was asked to end is killed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add whether MLflow's pages are served to the parser of this command."""
    parser.add_argument("--serve", action="store_true", help="then serve MLflow's pages until Ctrl-C")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Track every experiment of the settings."""
    from pipeline.tracking import mlflow_runs
    from tactile.inference import mlflow_store

    host, port = urlsplit(mlflow_store.UI).hostname, urlsplit(mlflow_store.UI).port
    if given.serve and mlflow_store.server():
        raise InputError("--serve: MLFLOW_TRACKING_URI names another store; open its own pages, or unset it")
    if given.serve and answers(host, port):
        raise InputError(f"--serve: something answers at {mlflow_store.UI} already; end it first")
    links = mlflow_runs.track(workspace, params.load(workspace.params))
    if given.serve:
        serve(workspace, host, port, links)


def answers(host: str, port: int) -> bool:
    """Tell whether something listens at a port."""
    with socket.socket() as tried:
        return tried.connect_ex((host, port)) == 0


def serve(workspace: Workspace, host: str, port: int, links: list[str]) -> None:
    """Serve MLflow's pages on the default store until Ctrl-C; a browser, if there is one, opens the first link.

    A SIGTERM ends MLflow's processes, too.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    command = [sys.executable, "-m", "mlflow", "ui", "--workers", "1", "--host", host, "--port", str(port)]
    command += ["--backend-store-uri", f"sqlite:///{workspace.mlflow_database}"]
    quiet = {"MLFLOW_DISABLE_TELEMETRY": "true", "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as log:
        server = subprocess.Popen(command, env=os.environ | quiet, stdout=log, stderr=log)
        try:
            until = time.monotonic() + LONGEST_START_S
            while not answers(host, port):
                if server.poll() is not None or time.monotonic() > until:
                    log.seek(0)
                    said = log.read().strip().splitlines() or ["it does not answer"]
                    raise InputError(f"MLflow's server did not start: {said[-1]}")
                time.sleep(0.2)
            print(f"http://{host}:{port} shows the runs; Ctrl-C ends it", flush=True)
            if links:
                webbrowser.open(links[0])
            server.wait()
        finally:
            server.terminate()
            try:
                server.wait(STOP_S)
            except subprocess.TimeoutExpired:
                server.kill()
