"""A figure is drawn when it has changed, now and then anyway, and as it was in the end."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.scene.status_curves import PERIOD_NS, Curves
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.recording.write.writer import RecordingWriter
from tests.support.recordings import SCALAR, read_column

SECOND_NS = 1_000_000_000


def test_constants_are_drawn_rarely_and_changes_at_once(tmp_path):
    writer = RecordingWriter(tmp_path, "run", DiskBudget(10**9, 0), build_blueprint(None))
    curves = Curves(writer)
    period_s = PERIOD_NS // SECOND_NS
    for second in range(2 * period_s + 10):
        writer.at(second * SECOND_NS)
        curves.draw("steps", 1.0 if second < 5 else 2.0)
        curves.draw("noisy", 100.0 + second % 2, noise=0.05)
        curves.draw("last", 100.0 + (second > 2 * period_s + 5), noise=0.05)
    curves.finish()
    assert writer.close()
    (part,) = tmp_path.glob("*.rrd")
    steps = read_column(part, "steps", SCALAR)
    assert (steps.wall_ns // SECOND_NS).tolist() == [0, 5, 5 + period_s, 5 + 2 * period_s]
    assert steps.values == [[1.0], [2.0], [2.0], [2.0]]
    noisy = read_column(part, "noisy", SCALAR)
    assert len(noisy.values) == 4
    assert read_column(part, "last", SCALAR).values[-1] == [101.0]
