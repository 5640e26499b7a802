"""Laser scans: what is kept of one, and the limit that no vector is long enough for."""

import math

import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire import schemas
from fasaco_edge.wire.limits import MAX_SCAN_BEAMS
from fasaco_edge.wire.messages.base import LaserScan, decode_scan, encode_scan
from tests.wire import oracle


def test_infinite_and_nan_ranges_are_kept():
    scan = LaserScan(-1.0, 0.5, 0.1, 8.0, (math.inf, -math.inf, math.nan, 2.0), "laser", 7)
    again = decode_scan(encode_scan(scan))
    assert again.ranges[:2] == (math.inf, -math.inf)
    assert math.isnan(again.ranges[2])
    assert (again.frame, again.stamp_ns, again.ranges[3]) == ("laser", 7, 2.0)


@pytest.mark.parametrize(
    ("beams", "is_read"), [(MAX_SCAN_BEAMS, True), (MAX_SCAN_BEAMS + 1, False)]
)
def test_the_number_of_beams_of_a_scan_is_limited(beams, is_read):
    payload = oracle.to_bytes(schemas.LASER_SCAN, oracle.scan([1.0] * beams, 0.0, 1e-4))
    if is_read:
        assert len(decode_scan(payload).ranges) == beams
        return
    with pytest.raises(MalformedMessage, match="length of ranges must be 1"):
        decode_scan(payload)


@pytest.mark.parametrize("wrong", [{"ranges": ()}, {"step_rad": math.nan}, {"most_m": 0.05}])
def test_a_scan_that_readers_would_refuse_is_not_written(wrong):
    told = {"first_rad": 0.0, "step_rad": 0.1, "least_m": 0.1, "most_m": 8.0, "ranges": (1.0, 2.0)}
    with pytest.raises(MalformedMessage):
        encode_scan(LaserScan(**told | wrong))
