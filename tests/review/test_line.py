"""Figures of a mission along a line over the floor, which passes beside the centres of cells."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.review.output.panels import covered_share
from fasaco_edge.review.review import read_review
from tests.support.recorded_mission import record_mission
from tests.support.reviews import document


def test_shares_are_reached_as_the_daemon_counted(tmp_path):
    recording = record_mission(tmp_path, line="thorough")
    review = read_review(recording.paths)
    told, coverage = document(review), recording.status["coverage"]
    # The track alone does not tell that all is covered.
    assert review.drive.coverage.covered < coverage["covered"] == coverage["coverable"]
    assert told["covered_cells"] == told["coverable_cells"] == coverage["coverable"]
    assert told["recovered_cells"] == coverage["recovered"]
    counts = [
        (sample.at_s, sample.status.coverage.covered)
        for sample in review.data.statuses
        if sample.status.coverage
    ]
    for percent, at_s in told["reached_s"].items():
        needed = -(-coverage["coverable"] * int(percent) // 100)
        at = next(at for at, (_, count) in enumerate(counts) if count >= needed)
        # A status comes each quarter of a minute; the robot covers cells between them, too.
        before_s = counts[at - 1][0] if at else 0.0
        assert before_s - 1e-3 <= at_s <= counts[at][0] + 1e-3
        if at and counts[at][1] > needed > counts[at - 1][1]:
            assert before_s < at_s < counts[at][0]
    at_s, shares = covered_share(review)
    assert np.all(np.diff(at_s) >= 0.0)
    assert len(shares) == coverage["coverable"]
    assert shares[-1] == 1.0
