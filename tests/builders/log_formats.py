"""Define formats of logs for tests of the reader."""

from tactile.logs import parse
from tactile.logs.formats import Column, Format

CLOCK = Column("t_us", "us", 0, 1e6 * parse.LONGEST_S, integer=True)  # no time is too late for a log
COUNTS = Format((CLOCK, Column("v0", "counts", 0, 1023, True), Column("v1", "counts", 0, 1023, True)), "t_us")
SPACED = Format((Column("reading", "1", 0, 1e5), Column("unix_s", "s", 1e9, 4e9)), "unix_s", separator=" ")
