"""Make docs/live.png and docs/mlflow.png anew: python -m tools.pictures

A headless Chromium opens the live page on the sample, at a moment with two touches and two tips, and the first
comparison of `tactile track --serve`. That takes two to four minutes, in which MLflow's port must be free.
"""

import base64
import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.builders.browser import Browser

ROOT = Path(__file__).parents[1]
TACTILE = [sys.executable, "-m", "tactile.commands.command_line"]
MOST_BYTES = 300_000
# Two touches where two tips press hard, 5 s after the page was opened, so that there is a course of the force.
PRESSED = """new Promise((end) => {
  const look = () => {
    const two = shown?.touches?.length === 2 && shown.tips?.length === 2 && shown.force_n > 25;
    if (two && shown.t_s - history[0][0] > 5) { freeze(new Date()); end(1); } else requestAnimationFrame(look);
  };
  look();
})"""
CLOSE = (
    """document.querySelectorAll('button[aria-label*="lose" i]').forEach((button) => button.click())"""  # the assistant
)
BARS = "document.querySelectorAll('.barlayer .point').length"


@contextlib.contextmanager
def said(*words: str) -> Iterator[Iterator[str]]:
    """Run `tactile` with these words, and yield the lines that it prints; it is ended with the block."""
    process = subprocess.Popen(
        [*TACTILE, *words],
        cwd=ROOT,
        env=os.environ | {"BROWSER": "true"},  # the program, which opens nothing
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield iter(process.stdout.readline, "")
    finally:
        process.terminate()
        process.wait()


def photograph(browser: Browser, name: str, width: int, height: int | None = None) -> None:
    """Write what the browser shows to a picture of docs/; height: None: the whole page."""
    height = height or browser.run("document.documentElement.scrollHeight")
    clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
    taken = browser.call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)["data"]
    picture = base64.b64decode(taken)
    if len(picture) > MOST_BYTES:
        sys.exit(f"docs/{name}: {len(picture)} bytes, more than {MOST_BYTES}")
    (ROOT / "docs" / name).write_bytes(picture)
    print(f"docs/{name}: {len(picture)} bytes")


def live(browser: Browser) -> None:
    """Take the picture of the live page."""
    with said("demo", "--live", "--http-port", "0") as lines:
        address = next(line.split()[0] for line in lines if line.startswith("http://"))
        browser.width(1100)
        browser.open(address)
        browser.run(PRESSED)
        photograph(browser, "live.png", 1100)


def mlflow(browser: Browser) -> None:
    """Take the picture of MLflow's first comparison, once its charts stay as they are."""
    with said("track", "--serve") as lines:
        until_served = []
        for line in lines:
            until_served.append(line)
            if "shows the runs" in line:
                break
        else:
            sys.exit("".join(until_served))
        link = next(line.rpartition(" ")[2].strip() for line in until_served if "compare them at" in line)
        browser.call("Emulation.setDeviceMetricsOverride", width=1600, height=900, deviceScaleFactor=1, mobile=False)
        browser.open(link)
        deadline, bars = time.monotonic() + 120, -1
        while bars <= 0 or bars != browser.run(BARS):
            if time.monotonic() > deadline:
                sys.exit(f"{link}: MLflow draws no bars")
            bars = browser.run(BARS)
            time.sleep(5)
        browser.run(CLOSE)
        time.sleep(5)
        photograph(browser, "mlflow.png", 1600, 900)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as profile:
        opened = Browser(Path(profile))
        live(opened)
        mlflow(opened)
        opened.close()
