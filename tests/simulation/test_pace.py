"""Simulated time against a wall clock given by hand."""

import pytest

from fasaco_edge.simulation.node import Pace


def ticks_until(pace, begin_s, end_s, cost_s):
    """Run ticks that take ``cost_s`` each, as soon as they are due."""
    now_s, count = begin_s, 0
    while now_s < end_s:
        if pace.behind_s(now_s) >= 0.0:
            pace.ticked(now_s)
            now_s += cost_s
            count += 1
        else:
            now_s -= min(pace.behind_s(now_s), -1e-4)
    return count


def test_a_fast_machine_keeps_the_speed_and_a_slow_one_falls_behind():
    pace = Pace(20.0, 0.02, 100.0)
    assert ticks_until(pace, 100.0, 110.0, 1e-4) * 0.02 == pytest.approx(200.0, rel=0.01)
    pace = Pace(10.0, 0.02, 0.0)
    assert ticks_until(pace, 0.0, 10.0, 0.01) == pytest.approx(1000, abs=2)
    # 80 s of simulated time were lost; at most a tenth of a second's worth is made good.
    after = ticks_until(pace, 10.0, 12.0, 1e-5)
    assert after * 0.02 == pytest.approx(20.0 + 0.1 * 10.0, rel=0.02)
