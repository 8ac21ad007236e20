"""Draw docs/check.svg: what `tactile check` shows of a sensor's lines. Write it anew from the checkout's root by
`PYTHONPATH=.:tests python -m builders.terminal`.
"""

import contextlib
import html
import io
import shutil
import tempfile
from pathlib import Path

from builders.project import ROOT
from tactile.base import params
from tactile.experiments import touch
from tactile.own import recordings, summary

PICTURE = ROOT / "docs" / "check.svg"
FORMAT = {"load_cell.log": {"separator": "text", "scale": 0.00981}}  # grams, as docs/own_sensor.md has it
LOGS = ("array.log", "load_cell.log", "cnc.log")
COLUMNS, LINE, WIDTH = 120, 18, 8.43  # of a terminal; pixels of a line and of a character of 14 pixels


def shown(folder: Path) -> list[str]:
    """What `check` shows of the logs of data/sample, whose load cell prints words and grams here."""
    recording = shutil.copytree(ROOT / "data/sample/double/two_touches", folder / "double/two_touches")
    lines = (recording / "load_cell.log").read_bytes().decode("utf-8", "replace").splitlines()
    rows = (line.partition(",") for line in lines)
    words = (f"{t},Load_cell output val: {float(f) / 0.00981:.2f}" if t.isdigit() and f else t for t, _, f in rows)
    (recording / "load_cell.log").write_text("\n".join(words) + "\n")
    settings = params.load(ROOT / "params.yaml")["touch"]
    settings["ingest"] = settings["ingest"] | {"format": FORMAT}
    with contextlib.redirect_stdout(io.StringIO()) as said:
        lines = summary.Shown()
        for name, fmt in touch.formats(settings, recording).items():
            if name in LOGS:
                one = recordings.read_one("touch", recording / name, fmt, settings)
                lines.show(recording / name, fmt, one, FORMAT.get(name))
    return said.getvalue().splitlines()


def svg(lines: list[str]) -> str:
    """Lines of a terminal as a picture; those of what is read are blue."""
    width, height = round((COLUMNS + 2) * WIDTH), LINE * (len(lines) + 1)
    texts = []
    for k, line in enumerate(lines):
        bare = line.lstrip()
        x, y = WIDTH * (1 + len(line) - len(bare)), LINE * (k + 1)
        colour = "#7ec8ff" if bare.startswith("->") else "#ffffff" if line[:3].strip() else "#c8c8c8"
        texts.append(f'<text x="{x:.2f}" y="{y}" fill="{colour}">{html.escape(bare)}</text>')
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}"',
            '  font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="14">',
            '<rect width="100%" height="100%" rx="6" fill="#1e1e1e"/>',
            *texts,
            "</svg>\n",
        ]
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        PICTURE.write_text(svg(shown(Path(place))))
