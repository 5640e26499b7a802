"""The page's words for an owner: there are some for all that a status can say."""

from __future__ import annotations

import re

import pytest

from fasaco_edge.daemon.loop import mission_reports
from fasaco_edge.mission.events import State
from fasaco_edge.mission.line import unswept
from fasaco_edge.mission.work import uncovered
from fasaco_edge.serve import plain
from fasaco_edge.wire.documents.json_text import decode_tolerant, encode_json
from fasaco_edge.wire.documents.replies import STATES, TROUBLES
from fasaco_edge.wire.documents.status import Status
from tests.support.statuses import FULL

# An engineer's words.
TECHNICAL = re.compile(
    r"\b(cells?|line polished|revision|daemon|bus|topic|pose|localiser|pheromone|lattice|covered|"
    r"coverable|configuration|order|zone|m2)\b|path \d|map:|_"
)


def status(**members: object) -> Status:
    return decode_tolerant(encode_json(FULL | members), Status)


def told(of: Status) -> list[str]:
    return [
        plain.word(of.state),
        plain.does(of),
        *plain.needs(of),
        *(part.reason for part in plain.left(of)),
    ]


def test_a_state_looks_bad_where_people_have_to_help():
    looks = {state: plain.look(status(state=state, troubles=[])) for state in STATES}
    assert [state for state, look in looks.items() if look == "bad"] == ["blocked", "degraded"]
    assert [state for state, look in looks.items() if look == "wait"] == ["paused"]
    at_rest = ["idle", "waiting for map", "waiting for pose", "loading"]
    assert [state for state, look in looks.items() if look == ""] == at_rest
    assert plain.look(status(state="covering", troubles=[{"code": "no_pose"}])) == "bad"


@pytest.mark.parametrize("state", STATES)
def test_each_state_has_plain_words(state):
    """Whatever the reasons and troubles are."""
    troubles = [{"code": code, "text": "pose 3 covered", "do": "check it"} for code in TROUBLES]
    for stage in ("covering", "retrying", "returning", "over", None):
        for path in (FULL["path"], FULL["path"] | {"steps": 0}, None):
            mission = FULL["mission"] | {"ordered": "command", "stage": stage}
            of = status(state=state, reason="map: 3 cells", mission=mission, path=path)
            assert not [text for text in told(of) if TECHNICAL.search(text)]
    needs = plain.needs(status(state=state, troubles=troubles))
    assert len(set(needs)) == len(TROUBLES)
    assert not [text for text in needs if TECHNICAL.search(text)]


@pytest.mark.parametrize("state", [state for state in State if state.is_at_rest])
def test_a_robot_at_rest_is_not_said_to_sweep(state):
    mission = FULL["mission"] | {"stage": "covering"}
    assert not plain.does(status(state=state, mission=mission)).startswith("Sweeps")


def test_a_room_that_is_waited_for_is_named():
    of = status(state="blocked", troubles=[], mission={"waits_for_room": "attic"})
    assert plain.does(of) == "Waits for attic"
    assert plain.needs(of)[:1] == [plain.UNKNOWN_ROOM]


def test_all_reasons_for_floor_left_have_an_owners_words():
    reasons = {
        *unswept.OUT_OF_REACH.values(),
        *uncovered.REASONS.values(),
        mission_reports.PASSED,
        mission_reports.BESIDE,
    }
    assert reasons == set(plain.LEFT)
    assert {mission_reports.ON_PATH, *mission_reports.LATER} == set(plain.TO_COME)
    assert uncovered.LEFT_OVER.startswith(plain.TRIED)
    assert not [text for text in (*plain.LEFT.values(), plain.ENDED) if TECHNICAL.search(text)]
    of_floor = {*unswept.OUT_OF_REACH.values(), mission_reports.PASSED, mission_reports.BESIDE}
    assert set(plain.MARKS) == of_floor | set(plain.TO_COME)


def test_floor_left_is_listed_once_with_its_marks():
    """No spot has two reasons: floor counts before cells, but for cells that are no floor."""
    narrow, closed, *_ = plain.LEFT
    beside = "beside the path, and not worth the way"
    floor = {
        "swept_m2": 9.0,
        "left": [{"m2": 3.0, "reason": "on the path"}, {"m2": 0.9, "reason": beside}],
        "out_of_reach": [{"m2": 1.5, "reason": closed}, {"m2": 0.01, "reason": narrow}],
    }
    areas = [
        {"m2": 0.9, "x": 1.0, "y": 2.0, "reason": "closed off by obstacles"},
        {"m2": 0.7, "x": 3.0, "y": 4.0, "reason": "left over after 2 tries, robot stands"},
        {"m2": 0.2, "x": 5.0, "y": 6.0, "reason": "no longer free on the map"},
    ]
    mission = {"ordered": "command", "stage": "covering", "unreached": {"areas": areas}}
    underway = status(floor=floor, mission=mission)
    assert told_left(underway) == [
        (1.5, "no way in: a closed door, or something in the way", 2, []),
        (0.9, "it could not get there", 16, []),
        (0.2, "something stands there now", 0, [(5.0, 6.0)]),
    ]
    over = status(floor=floor, mission=mission | {"stage": "over"})
    assert told_left(over)[0] == (3.0, "for another reason", 32, [])
    # Much that was passed, and is not known to be swept: poses were far apart.
    for m2, said in ((0.4, plain.LEFT[mission_reports.PASSED]), (2.0, plain.SELDOM)):
        parts = floor | {
            "reachable_m2": 9.0,
            "left": [{"m2": m2, "reason": mission_reports.PASSED}],
        }
        assert (m2, said, 8, []) in told_left(status(floor=parts, mission=mission))
    # Where only cells are counted, they tell it.
    counted = status(floor={"swept_m2": 9.0}, mission=mission)
    assert [m2 for m2, *_ in told_left(counted)] == [0.9, 0.7, 0.2]
    # A canceled order asks for no floor any more: what it left is remembered.
    canceled = status(floor=floor | {"left": []}, mission=mission | {"ordered": None})
    assert told_left(canceled, underway)[0] == (3.9, plain.ENDED, plain.REST, [])
    assert told_left(canceled) == []
    # Of one that was cancelled before the page's server began, the map shows where.
    cancelled = mission | {"ordered": None, "last_order": {}, "unreached": {"areas": []}}
    assert told_left(status(floor=floor | {"left": []}, mission=cancelled)) == [
        (None, plain.ENDED, plain.REST, []),
        (1.5, "no way in: a closed door, or something in the way", 2, []),
    ]
    forgotten = status(floor={"swept_m2": 0.0}, mission=mission | {"ordered": None})
    assert told_left(forgotten, underway) == []


@pytest.mark.parametrize(
    ("behind_m2", "obstacles_m2", "said"),
    [
        (0.0, 0.5, plain.NO_WAY),
        (0.0, 0.0, plain.NO_WAY),
        (0.5, 0.0, "behind a keep-out"),
        (0.5, 0.2, plain.BEHIND_OR_NO_WAY),
    ],
)
def test_floor_behind_a_keep_out_has_that_reason(behind_m2, obstacles_m2, said):
    areas = [{"m2": behind_m2, "reason": plain.BEHIND}]
    areas += [{"m2": obstacles_m2, "reason": plain.OBSTACLES}]
    floor = {"swept_m2": 9.0, "left": [], "out_of_reach": [{"m2": 2.0, "reason": plain.CLOSED}]}
    mission = {"ordered": "command", "stage": "over", "unreached": {"areas": areas}}
    assert told_left(status(floor=floor, mission=mission)) == [(2.0, said, 2, [])]


def test_a_robot_without_a_map_is_shown_so():
    assert "no map" in plain.does(status(state="idle", map=None))
    assert plain.does(status(state="idle")) == "Ready to sweep"


def told_left(of: Status, ordered: Status | None = None) -> list[tuple[object, ...]]:
    parts = plain.left(of, ordered)
    return [(part.m2 and round(part.m2, 3), part.reason, part.marks, part.places) for part in parts]
