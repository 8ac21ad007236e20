"""The rate of lines, and which are missing, where they come in packets and where they do not."""

import numpy as np
import pytest
from builders.packets import arrived, stamps_us

from tactile.datasets import schemas
from tactile.logs import packets


def printed(hz, seconds=30.0, jitter=0.0, seed=0):
    """Times in s of lines at a rate, each interval wrong by up to a share of it, but for a silence of half a second."""
    rng = np.random.default_rng(seed)
    time = 5 + np.cumsum((1 + jitter * rng.uniform(-1, 1, round(seconds * hz))) / hz)
    return time[(time < 20) | (time > 20.5)]


def one_segment(time):
    return np.zeros(len(time), np.int16)


@pytest.mark.parametrize("packet_s", [0.016, 0.004])
@pytest.mark.parametrize("hz", [50, 100, 200, 500, 1000])
def test_lines_in_packets_get_the_times_at_which_they_were_printed(hz, packet_s):
    true_s = printed(hz)
    stamped = stamps_us(arrived(true_s, packet_s, np.random.default_rng(1)))
    time, rate = packets.spread(stamped, one_segment(stamped), 1)
    assert 1e6 / rate.interval == pytest.approx(hz, rel=2e-3)
    assert (np.diff(time) > 0).all() and time.dtype == stamped.dtype
    gaps = np.flatnonzero(schemas.gaps(time, one_segment(time)))
    silence = int(np.argmax(np.diff(true_s))) + 1
    assert len(gaps) == 1 and abs(gaps[0] - silence) <= packet_s * hz
    error_s = time / 1e6 - true_s
    assert np.ptp(np.quantile(error_s, [0.1, 0.9])) <= 1.1 * min(packet_s, 1 / hz)


@pytest.mark.parametrize(("hz", "packet_s"), [(50, 0.016), (60, 0.016), (200, 0.004)])
def test_lines_now_one_and_now_two_packets_apart_are_none_lost(hz, packet_s):
    stamped = stamps_us(arrived(printed(hz), packet_s, np.random.default_rng(1), late=0))
    time, rate = packets.spread(stamped, one_segment(stamped), 1)
    assert 1e6 / rate.interval == pytest.approx(hz, rel=2e-3)
    assert rate.packet == pytest.approx(1e6 * packet_s, rel=0.1)
    assert schemas.gaps(stamped, one_segment(stamped)).sum() > 50 and schemas.gaps(time, one_segment(time)).sum() == 1


@pytest.mark.parametrize("packet_ms", [16, 1])
def test_the_rate_is_known_after_a_second(packet_ms):
    """As live, of lines at 100 and 1,000 a second."""
    for hz in (100, 1000):
        time_s = arrived(printed(hz, seconds=1), packet_ms / 1e3, np.random.default_rng(0))
        assert 1 / packets.rate(time_s).interval == pytest.approx(hz, rel=0.01)


@pytest.mark.parametrize("lost", [0, 0.005, 0.05, 0.2])
@pytest.mark.parametrize(("hz", "jitter"), [(5, 0.2), (50, 0), (100, 0.1), (1000, 0.02)])
def test_times_of_single_lines_stay_as_they_are(hz, jitter, lost):
    time = np.round(1e6 * printed(hz, seconds=max(30, 500 / hz), jitter=jitter)).astype(np.int64)
    time = time[np.random.default_rng(2).random(len(time)) >= lost]
    unchanged, rate = packets.spread(time, one_segment(time), 1)
    assert unchanged is time and rate == (np.median(np.diff(time)), 0)


def test_a_restart_is_no_interval():
    stamped = stamps_us(arrived(printed(500), 0.016, np.random.default_rng(1)))
    segment = np.repeat([0, 1], len(stamped))
    time, rate = packets.spread(np.tile(stamped, 2), segment, 1)
    assert 1e6 / rate.interval == pytest.approx(500, rel=2e-3)
    assert schemas.gaps(time, segment).sum() == 2 and (np.diff(time) < 0).sum() == 1


@pytest.mark.parametrize(
    ("rate", "apart", "missing"),
    [
        (packets.Rate(0.02, 0), 0.021, 0),
        (packets.Rate(0.02, 0), 0.039, 1),
        (packets.Rate(0.02, 0), 0.1, 4),
        (packets.Rate(0.001, 0.016), 0.000001, 0),
        (packets.Rate(0.001, 0.016), 0.06, 0),  # a late packet
        (packets.Rate(0.001, 0.016), 0.116, 100),
        (packets.Rate(0.02, 0.016), 0.032, 0),
    ],
)
def test_an_interval_of_k_means_k_less_one_lost_lines(rate, apart, missing):
    assert packets.missing_before(rate, 7.0, 7.0 + apart) == missing
