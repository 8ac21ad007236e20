"""Say in words what was understood of a recording, and show lines of its logs."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import pyarrow as pa

from tactile.datasets import schemas
from tactile.logs import parse, shown
from tactile.own import logs as own_logs
from tactile.own.recordings import Checked, Read

OFTEN = 0.05  # share of a log's lines that have a gap before them
SLOW_HZ = 25  # a touch device that is slower cannot be aligned to a press's rise of 0.1 s


def recording_summary(recording: Checked) -> Iterator[str]:
    """Yield lines of text about one recording."""
    yield f"\n{recording.name}"
    for name, log in recording.logs.items():
        report = recording.report.get(name, log.report)
        rejects = ", ".join(f"{reason} {count}" for reason, count in report["rejects"].items())
        first = rejects and f" (first: line {log.rejects['line'][0].as_py()})" if log.rejects.num_rows else ""
        yield (
            f"  {name:<16} {report['lines']} lines, {report['accepted']} accepted, "
            f"{sum(report['rejects'].values())} rejected{': ' if rejects else ''}{rejects}{first}"
        )
        rate = f"{report['rate_hz']:.2f} Hz" if report["rate_hz"] else "rate unknown"
        yield f"{'':19}{rate}, {report['gaps']} gaps, {report['segments']} segments; {value_ranges(log.rows)}"
        if packet_s := parse.packet_s(log.rows):
            yield (
                f"{'':19}times come in packets of {1e3 * packet_s:.0f} ms, or in such steps, as a serial adapter hands "
                "lines on: they were spread evenly"
            )
        if report["gaps"] > OFTEN * report["lines"]:
            yield (
                f"{'':19}gaps, times between lines of more than {schemas.LONG:g} usual ones, are in "
                f"{100 * report['gaps'] / report['lines']:.0f} % of them: no window goes over a gap, so few are left"
            )
        for reading, (count, longest) in log.report.get("filled", {}).items():
            lasts = f", or {longest / report['rate_hz']:.3g} s" if report["rate_hz"] else ""
            yield (
                f"{'':19}{reading}: missing in {100 * count / report['lines']:.2g} % of the lines, and taken from the "
                f"line before; in up to {longest} lines on end{lasts}"
            )
        if name == "array.log" and report["rate_hz"] and report["rate_hz"] < SLOW_HZ:
            yield f"{'':19}slower than {SLOW_HZ} Hz: presses may not be aligned well, and windows are few"
        for clock in filter(None, report.get("clocks", [report.get("clock")])):
            yield f"{'':19}clock: {of_clock(clock)}"
        yield from (f"{'':19}finding: {warning}" for warning in report.get("warnings", []))
        for channel, fault in report.get("channels", {}).items():
            yield f"{'':19}{channel}: {fault['fault']} in {100 * fault['share']:.0f} % of the time"
    yield from (f"  problem: {problem}" for problem in recording.problems)


class Shown:
    """Prints lines of each log, once for all recordings that are laid out alike."""

    def __init__(self):
        self._seen: set[tuple[str, str]] = set()

    def show(self, path: Path, fmt: parse.Format, one: Read, laid_out: Mapping | None) -> None:
        """Print lines of a log with what is read from them; laid_out: as the settings, or else a proposal, has it."""
        key = path.name, own_logs.on_a_line(one.proposal.layout if one.proposal else {"read": one.log is not None})
        if key in self._seen:
            return
        self._seen.add(key)
        heading, log = f"  {path.name} of {path.parent.parent.name}/{path.parent.name}: lines of it as printed", one.log
        if one.proposal is not None:
            log = own_logs.read_one(path, fmt, laid_out)
            rate = "" if one.proposal.layout.get("rate_hz", 0) is not None else ", at 1 line a second"
            print(f"{heading}, and what the block below would read from them{rate}")
        elif log is not None:
            print(f"{heading}, and what is read from them")
        else:
            print(f"{heading}, from which nothing is read")
        if log is None:
            said = shown.first_lines(path)
        else:
            said = shown.lines(path, log.rows, log.rejects, fmt, laid_out)
        print("\n".join(said))


def of_clock(clock: Mapping) -> str:
    """Return the numbers of a clock in words; clock: as ingest reports it."""
    if "correlation" not in clock:
        return "shared; the other logs are measured against this one"
    if clock["correlation"] is None:
        return "shared, not measured: too few presses, or too little motion, to tell"
    if "measured_offset_ms" in clock:
        return (
            f"shared, correlation {clock['correlation']:.2f}; best {clock['best_correlation']:.2f}, at an offset of "
            f"{clock['measured_offset_ms']:+.0f} ms, which is not applied"
        )
    return (
        f"offset {clock['offset_ms']:+.0f} ms, drift {clock['drift_ppm']:+.0f} ppm, "
        f"correlation {clock['correlation']:.2f}"
    )


def value_ranges(rows: pa.Table) -> str:
    """Return the smallest and largest value of each kind of column: v0 .. v24 are one kind, x_mm and y_mm are two."""
    kinds: dict[str, list[str]] = {}
    for name in rows.column_names:
        if name not in ("t_us", "t_s", "time_s", "line", "segment"):
            kinds.setdefault(re.sub(r"\d+$", "", name), []).append(name)
    parts = []
    for names in kinds.values():
        values = [rows[name].to_numpy() for name in names]
        low, high = min(v.min() for v in values) + 0.0, max(v.max() for v in values) + 0.0  # no -0
        columns = names[0] if len(names) == 1 else f"{names[0]} .. {names[-1]}"
        parts.append(f"{columns} {low:g} to {high:g}")
    return ", ".join(parts)
