"""Read our numbers out of the tables of README.md, and look for each of them among the runs of MLflow."""

import re
from typing import NamedTuple

TITLES = {  # of columns -> what a run calls the score, and how many of the table's units are one of it
    **{"One touch": ("main/single.rmse", 1), "Two touches": ("main/double.rmse", 1)},
    **{"Task 1": ("main/task_1.error", 1), "Task 2": ("main/task_2.error", 1)},
    **{"Pressure": ("main/pressure.macro_precision", 100), "Bending": ("main/strain.macro_precision", 100)},
    "Pressure and bending": ("main/combined.macro_precision", 100),
}
NUMBER = re.compile(r"\[([\d.]+)\]\(reports/(shards\.md#[\w-]+)\)(?: \[[\d., ]+\])?$")


class Number(NamedTuple):
    """A number of ours: its row, its column's title, its text and where it leads."""

    model: str
    title: str
    text: str
    link: str


def numbers(text: str) -> list[Number]:
    """Return our numbers in the tables; AssertionError where a cell is no number with a link."""
    found, header = [], []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if not cells or not header:
            header = cells
        elif not set(line) <= set("|-: "):
            for place, name in enumerate(header):
                if name == "ours":
                    assert (said := NUMBER.match(cells[place])), cells
                    found.append(Number(cells[0], header[place - 1].partition(":")[0], *said.groups()))
    return found


def without_run(found: list[Number], runs: list) -> list[Number]:
    """Return the numbers that no run marked `readme`, or more than one, has; runs: of MLflow."""
    return [number for number in found if sum(_holds(run, number) for run in runs) != 1]


def _holds(run, number: Number) -> bool:
    metric, units = TITLES[number.title]
    value = run.data.metrics.get(metric)
    marked = run.data.tags.get("readme") == run.data.tags.get("current") == "true"
    return (
        marked
        and run.data.params["model"] == number.model
        and value is not None
        and f"{units * value:.2f}" == number.text
    )
