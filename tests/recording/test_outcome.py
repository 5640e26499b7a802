"""The run card says what became of the mission."""

from __future__ import annotations

import pytest

from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.recording.scene.outcome import Outcome
from fasaco_edge.wire.documents.json_text import decode_tolerant, encode_json
from fasaco_edge.wire.documents.status import Status
from tests.support.statuses import FULL

FLOOR = {"swept_m2": 47.7, "reachable_m2": 49.4, "left": None, "out_of_reach": None}
SIMULATED = {"config": {"robot": {"time_scale": 20.0}}}


def outcome(*states, driven_s=90.0, first_ns=5_000_000_000, **members):
    """Return the line after a drive, and these states with their reasons."""
    one = Outcome()
    for stamp_ns in (first_ns, first_ns + round(driven_s * 1e9) if first_ns else 0):
        one.add_pose(StampedPose(Pose2D(1.0, 1.0), stamp_ns=stamp_ns))
    for state, reason in states:
        known = FULL | {"floor": None} | members | {"state": state, "reason": reason}
        one.add_status(decode_tolerant(encode_json(known), Status))
    return one.text


@pytest.mark.parametrize(
    ("said", "line"),
    [
        (outcome(("covering", "")), ""),
        (outcome(("done", "all is covered")), "**done** after 1 min 30 s: all is covered"),
        (outcome(("done", "all is covered"), first_ns=0), "**done**: all is covered"),
        (outcome(("done", "9 m2 swept"), floor=FLOOR), "**done** after 1 min 30 s: 9 m2 swept"),
        (
            outcome(("degraded", "it stands"), floor=FLOOR, **SIMULATED),
            "**degraded** after 1 min 30 s (simulated at 20 times real time): it stands; "
            "47.7 of 49.4 m2 swept",
        ),
        (outcome(("degraded", "it stands"), ("covering", "")), ""),
    ],
)  # fmt: skip
def test_the_outcome_is_said_where_there_is_one(said, line):
    assert said == line
