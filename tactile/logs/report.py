"""Report in numbers how a log was understood: lines, rejects, rate, gaps and segments."""

from collections import Counter

import numpy as np
import pyarrow as pa

from tactile.datasets import schemas


def log_report(accepted: int, rejects: pa.Table, time_s: np.ndarray, segment: np.ndarray) -> dict:
    """Return the numbers of one log: lines (without a header), rejects per reason, rate, gaps and segments.

    time_s, segment: (n,), of the lines that could be placed in time; a gap is an interval with missing lines.
    """
    interval = np.diff(time_s)[segment[1:] == segment[:-1]]
    reasons = Counter(rejects["reason"].to_pylist())
    return {
        "lines": accepted + rejects.num_rows,
        "accepted": accepted,
        "rejects": dict(sorted(reasons.items())),
        "rate_hz": 1 / float(np.median(interval)) if len(interval) else None,
        "gaps": int(schemas.gaps(time_s, segment).sum()),
        "segments": len(np.unique(segment)),
    }
