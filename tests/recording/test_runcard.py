"""The run card and the run's properties, from whatever a status gives."""

from __future__ import annotations

import pytest

from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.recording.scene.runcard import Outcome, RunDescription
from fasaco_edge.wire.documents.json_text import decode_tolerant, encode_json
from fasaco_edge.wire.documents.status import Status
from tests.support.statuses import FULL


def test_settings_stand_below_by_their_names():
    robot = {"name": "r2", "radius_m": 0.2}
    # A setting of any type makes a card.
    config = {
        "alpha": 1,
        "none": None,
        "many": [[], {}],
        "robot": robot,
        "planner": {"name": "fasaco", "seed": 7},
    }
    card = RunDescription("r2", "2026-01-01", "1.0", config).markdown().partition("| setting |")[2]
    first = ("alpha", "planner.name", "planner.seed", "robot.name", "robot.radius_m")
    order = [card.index(name) for name in ("r2", *first)]
    assert order == sorted(order)


@pytest.mark.parametrize(
    ("words", "value", "line"),
    [
        (("r2", "now", "1.0"), "a|b\nc", r"| planner | a\|b\\nc |"),
        (("[a](file:b)", "now", "![](c)"), "", r"| robot | \[a\](file:b) |"),
        (("r2", "now", "1.0"), "<img src=d>\x1b", r"| planner | \<img src=d\>\\x1b |"),
    ],
)
def test_a_value_breaks_no_table_and_is_no_link(words, value, line):
    card = RunDescription(*words, {"planner": value}).markdown()
    assert line in card.splitlines()


FLOOR = {"swept_m2": 47.7, "reachable_m2": 49.4, "left": None, "out_of_reach": None}
SIMULATED = {"config": {"robot": {"time_scale": 20.0}}}


def outcome(*states, driven_s=90.0, first_ns=5_000_000_000, **members):
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
        (outcome(), ""),
        (outcome(("covering", "")), "**under way**"),
        (outcome(("done", "all is covered")), "**done** after 1 min 30 s: all is covered"),
        (outcome(("done", "all is covered"), first_ns=0), "**done**: all is covered"),
        (
            outcome(("done", "every reachable cell is covered; 47.7 of 49.4 m2 of floor swept")),
            "**done** after 1 min 30 s: the tool has passed the centre of every cell that it "
            "reaches; 47.7 of 49.4 m2 of floor swept",
        ),
        (outcome(("done", "9 m2 swept"), floor=FLOOR), "**done** after 1 min 30 s: 9 m2 swept"),
        (
            outcome(("degraded", "it stands"), floor=FLOOR, **SIMULATED),
            "**degraded** after 1 min 30 s (simulated at 20 times real time): it stands; "
            "47.7 of 49.4 m2 swept",
        ),
        (outcome(("degraded", "it stands"), ("covering", "")), "**under way**"),
    ],
)  # fmt: skip
def test_the_outcome_is_shown_if_there_is_one(said, line):
    assert said == line
