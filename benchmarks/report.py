"""reports/benchmarks/README.md: benchmarks.csv and growth.csv in tables, and links to the tables beside it."""

import csv
from pathlib import Path

from benchmarks import growth
from tactile.base import files
from tactile.drawing.markdown import table

MET = {"yes": "yes", "no": "**no**", "failed": "**failed**", "": "-"}
TABLES = {  # in the folder of this report, each written by its benchmark
    "card.csv": "what an update of a training takes on a card, beside one thread of its machine",
    "inference.csv": "what one prediction takes of torch, of the predictor and of ONNX Runtime",
    "repro_stages.csv": "what each stage of a full run takes",
}
NO_BREAK = "\N{NO-BREAK SPACE}"  # a number stays with its unit


def write(folder: Path) -> None:
    """Write benchmarks/README.md of the two tables in `folder` (reports), as far as they are there."""
    rows, points = (_read(folder / name) for name in ("benchmarks.csv", "growth.csv"))
    parts = ["# How fast it is\n"]
    if rows:
        parts += ["By `python -m pytest benchmarks`; every figure and its peer's are medians of one run.\n"]
        for name in ("machine", "versions", "date"):
            parts.append(f"- {name}: {'; '.join(sorted({row[name] for row in rows}))}")
        parts.append("- all columns: [benchmarks.csv](../benchmarks.csv)")
        there = [name for name in TABLES if (folder / "benchmarks" / name).exists()]
        parts += [f"- {TABLES[name]}: [{name}]({name})" for name in there]
        parts.append("")
        parts += ["## Against a plain implementation\n", table(*comparison(rows))]
    if points:
        parts += ["## Growth with the size\n", "All columns: [growth.csv](../growth.csv)\n", table(*exponents(points))]
        parts += [f"- [{name}.png]({name}.png): {words}" for name, words in captions(points).items()]
    files.write_text(folder / "benchmarks" / "README.md", "\n".join(parts) + "\n")


def comparison(rows: list[dict]) -> tuple[list[str], list[list[str]]]:
    """Header and rows: a figure, the peer's, their ratio, the target."""
    header = ["What", "Ours", "Baseline", "Speed-up", "Target", "Met", "Threads", "Baseline is"]
    lines = []
    for row in rows:
        target = f"{float(row['target']):.3g}" if row["target"] else "-"
        if row["target_is"] == "ours at most":
            target = f"at most {target}{NO_BREAK}{row['unit']}"
        lines.append(
            [
                row["what"] or row["name"],
                *(f"{float(row[key]):.3g}{NO_BREAK}{row['unit']}" if row[key] else "-" for key in ("ours", "peer")),
                f"{float(row['ratio']):.3g}" if row["ratio"] else "-",
                *(target, MET[row["met"]], row["threads"] or "-", row["peer_is"] or "-"),
            ]
        )
    return header, lines


def exponents(points: list[dict]) -> tuple[list[str], list[list[str]]]:
    """Header and rows: how time and memory of a task grow."""
    lines = []
    for task in dict.fromkeys(point["task"] for point in points):
        own = sorted((point for point in points if point["task"] == task), key=lambda point: float(point["size"]))
        sizes = ", ".join(f"{float(point['size']):g}" for point in own)
        times, memory = (", ".join(f"{float(point[key]):.3g}" for point in own) for key in ("seconds", "mb"))
        powers = (f"{float(own[0][key]):.2f}" for key in ("time_exponent", "memory_exponent"))
        lines.append([growth.LOOKS[task][3], f"{sizes} {own[0]['size_unit']}", times, memory, *powers])
    return ["Task", "Sizes", "Time (s)", "Memory (MB)", "Exponent of time", "Exponent of memory"], lines


def captions(points: list[dict]) -> dict[str, str]:
    """Return what a size is of -> the caption of its figure: which task's time grows most with it, and which least."""
    said = {}
    for name in dict.fromkeys(point["against"] for point in points):
        powers = {point["task"]: float(point["time_exponent"]) for point in points if point["against"] == name}
        most, least = max(powers, key=powers.get), min(powers, key=powers.get)
        said[name] = (
            f"With more {name}, the time of {growth.LOOKS[most][3]} grows most, by the power {powers[most]:.2f}"
            + (f", that of {growth.LOOKS[least][3]} least, by {powers[least]:.2f}." if least != most else ".")
        )
    return said


def _read(path: Path) -> list[dict]:
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
