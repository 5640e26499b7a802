"""The page's words for the owner of the robot: what it does, what it needs, what it left unswept.

The mission's own reasons are for engineers: the page shows them among its details.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fasaco_edge.states import row_of
from fasaco_edge.wire.documents.replies import FloorLeft, FloorReport
from fasaco_edge.wire.documents.status import Status

NO_MAP = "Ready, but has no map of the rooms yet"
STUCK = "Something blocks its way: open doors and clear the floor. It tries again by itself."
UNKNOWN_ROOM = (
    "It knows no room of that name yet. Tap the room on the map and name it, or end the work."
)
NEEDS = {
    "not_begun": "It cannot begin without its map. Switch it off and on; if that does not help, "
    "call service.",
    "no_pose": "It has lost its place. Put it where it started; if that does not help, "
    "call service.",
    "pose_jumped": "It is finding its place again: wait a moment. If that does not help, "
    "call service.",
    "no_map": "It gets no new picture of the rooms. Switch it off and on; if that does not help, "
    "call service.",
    "no_battery": "It does not know how full its battery is. Call service.",
    "no_dock": "Its dock is not on this floor: bring it back there to charge.",
    "no_current": "It stands in its dock and does not charge. Check the plug, and how it stands.",
    "shut_in": "It is shut in. Open the door, or move what is in its way.",
    "blocked": "Something is in its way: clear it if you can. It sweeps elsewhere meanwhile.",
    "stands": "It does not move. Check whether a cable, a carpet or furniture holds it.",
    "beside_line": "It drives beside its path and may leave strips. Call service.",
    "two_publishers": "Two programs send it different maps or places. Call service.",
    "no_effect": "A keep-out, its home or its dock lies where it has seen no floor yet. If it has "
    "seen everything, check the map.",
}
"""What the owner can do about a trouble, by its code."""
UNSAVED = "It cannot save what it has swept: after a power cut it would start over. Call service."

# Reasons in ``floor.left`` of floor that is yet to be swept.
TO_COME = ("on the path", "to come", "not planned yet")
CLOSED = "closed off: no way leads there that the robot fits through"
BEHIND, OBSTACLES = "closed off by a keep-out zone", "closed off by obstacles"
NO_WAY = "no way in: a closed door, or something in the way"
BEHIND_OR_NO_WAY = "no way in: behind a keep-out, a closed door, or something in the way"
LEFT = {
    "too narrow for the robot, or too near to a wall or to furniture": "too narrow for the robot, "
    "or too close to a wall or furniture",
    CLOSED: NO_WAY,
    "in a keep-out zone, or too near to one": "in a keep-out, or close to one",
    "passed, or in narrow strips, and not known to be swept": "thin strips that it may have missed",
    "beside the path, and not worth the way": "small spots, not worth the way",
    "in a keep-out zone": "in a keep-out, or close to one",
    BEHIND: "behind a keep-out",
    OBSTACLES: NO_WAY,
    "no longer free on the map": "something stands there now",
    "unknown to the map": "it has not seen that part",
}
"""Why floor was left, in the owner's words, by the reason in the status."""
TRIED, OTHERWISE = "left over after", "for another reason"
NOT_REACHED = "it could not get there"
ENDED = "left when the work was ended"
# Reason of the mission if poses come too seldom, and its words for the owner.
FAR_APART = "poses are too far apart"
SELDOM = "it may have missed that: its place was not known often enough"
# Share of the reachable floor above which unswept floor may have this reason.
MUCH = 0.1
PASSED, BESIDE = 8, 16
MARKS = {
    "too narrow for the robot, or too near to a wall or to furniture": 1,
    CLOSED: 2,
    "in a keep-out zone, or too near to one": 4,
    "passed, or in narrow strips, and not known to be swept": PASSED,
    "beside the path, and not worth the way": BESIDE,
    "to come": BESIDE,
    "not planned yet": BESIDE,
    "on the path": 32,
}
"""The mark of each reason for unswept floor, see ``serve.messages.UNSWEPT_MARKS``."""
REST = 64
"""The mark of other unswept floor, which is part of no order any more."""
# Reasons of unreached cells without free floor, which figures of floor leave out.
NO_FLOOR = ("no longer free on the map", "unknown to the map")
# Least area that is listed [m2].
LEAST_M2 = 0.05
# Distance from home up to which the robot counts as at home [m].
NEAR_M = 0.5


def word(state: str) -> str:
    """Return one word for a state."""
    return row_of(state).word or state


def does(status: Status) -> str:
    """Return what the robot does now, in the owner's words."""
    mission, path = status.mission, status.path
    if status.state == "blocked" and mission.waits_for_room:
        return f"Waits for {mission.waits_for_room}"
    has_no_map = status.state == "idle" and status.map is None
    if words := NO_MAP if has_no_map else row_of(status.state).does:
        return words
    if status.state == "paused":
        return "Paused at home" if _is_home(status) else "Paused: waits for Resume"
    if status.state == "charging":
        goes_on = mission.ordered is not None and mission.stage != "over"
        return "Charges, then goes on by itself" if goes_on else "Charges"
    if status.state == "returning" or mission.stage == "returning":
        is_to_charge = status.battery is not None and status.battery.goes_on_at is not None
        return "Drives to its dock to charge" if is_to_charge else "Drives home"
    return _sweeps(status) if path is None or path.steps else "Waits a moment"


def look(status: Status) -> str:
    """Return the class of the state in the page's style sheet: bad, wait, go or ""."""
    row = row_of(status.state)
    if status.troubles or row.needs_help:
        return "bad"
    return {"grey": "", "amber": "wait"}.get(row.colour, "go")


def last_seen(status: Status) -> str:
    """Return what the robot did at its last status, in the owner's words."""
    did = does(status)
    return f"When last seen: {did[:1].lower()}{did[1:]}"


def _sweeps(status: Status) -> str:
    mission = status.mission
    if mission.stage == "retrying":
        return "Tries again where it could not get to"
    zone, passes = mission.zone or "everything it can reach", mission.passes or 1
    return f"Sweeps {zone}" + (f", pass {mission.pass_number} of {passes}" if passes > 1 else "")


def _is_home(status: Status) -> bool:
    home, pose = status.mission.home, status.pose
    if home is None or pose is None:
        return False
    return math.hypot(home.x - pose.x, home.y - pose.y) < NEAR_M


def needs(status: Status) -> list[str]:
    """Return what the robot needs from its owner, in the owner's words."""
    found = [NEEDS.get(each.code, "Call service.") for each in status.troubles]
    if status.state == "blocked" and not found:
        found.append(UNKNOWN_ROOM if status.mission.waits_for_room else STUCK)
    return found + ([UNSAVED] if status.ledger.fault else [])


@dataclass(slots=True)
class LeftFloor:
    """Unswept floor with one reason.

    Attributes:
        reason: why it is unswept, in the owner's words.
        m2: its area [m2]; None if that is not known.
        marks: its marks on the map, see ``MARKS``.
        places: points (x, y) in it [m], if it has no marks.
    """

    reason: str
    m2: float | None = 0.0
    marks: int = 0
    places: list[tuple[float, float]] = field(default_factory=list)


def left(status: Status, ordered: Status | None = None) -> list[LeftFloor]:
    """Return the unswept floor of an order, the largest part first.

    ``ordered``: the newest status with an order, which may be over by now; None before the first:
    then it is unknown how much a cancelled order left.
    """
    is_ended, found = status.mission.ordered is None, dict[str, LeftFloor]()
    if is_ended and not (status.floor and status.floor.swept_m2):
        return []
    if is_ended and ordered is None:
        if status.mission.last_order is None:
            return []
        found[ENDED] = LeftFloor(ENDED, None, REST)
    of = ordered if is_ended and ordered is not None else status
    mission, floor = of.mission, of.floor or FloorReport()
    for part in floor.left or ():
        reason, marks = _why_left(part, of)
        if is_ended and mission.stage != "over":
            reason, marks = ENDED, REST
        elif part.reason in TO_COME and mission.stage != "over":
            continue
        _add(found, reason, part.m2, marks)
    for part in floor.out_of_reach or ():
        reason = _why_closed(of) if part.reason == CLOSED else LEFT.get(part.reason, OTHERWISE)
        _add(found, reason, part.m2, MARKS.get(part.reason, 0))
    for area in mission.unreached.areas:
        # If the status has figures of floor, only areas that these leave out count.
        if floor.left is None or area.reason in NO_FLOOR:
            is_tried = area.reason.startswith(TRIED)
            reason = NOT_REACHED if is_tried else LEFT.get(area.reason, OTHERWISE)
            _add(found, reason, area.m2).places.append((area.x, area.y))
    larger = (kind for kind in found.values() if kind.m2 is None or kind.m2 >= LEAST_M2)
    return sorted(larger, key=lambda kind: -math.inf if kind.m2 is None else -kind.m2)


def _why_left(part: FloorLeft, of: Status) -> tuple[str, int]:
    """Return why a part of the reachable floor is left, in the owner's words, and its marks."""
    marks, areas = MARKS.get(part.reason, 0), of.mission.unreached.areas
    reachable_m2 = (of.floor and of.floor.reachable_m2) or math.inf
    is_far = FAR_APART in of.reason or any(FAR_APART in area.reason for area in areas)
    if part.m2 > MUCH * reachable_m2 and (marks == PASSED or (marks == BESIDE and is_far)):
        return SELDOM, marks
    tried_m2 = sum(area.m2 for area in areas if area.reason.startswith(TRIED))
    if marks == BESIDE and tried_m2 >= LEAST_M2:
        return NOT_REACHED, marks
    return LEFT.get(part.reason, OTHERWISE), marks


def _why_closed(of: Status) -> str:
    """Return why floor is closed off, in the owner's words, by the reasons of unreached cells."""
    m2 = {BEHIND: 0.0, OBSTACLES: 0.0}
    for area in of.mission.unreached.areas:
        if area.reason in m2:
            m2[area.reason] += area.m2
    if m2[BEHIND] < LEAST_M2:
        return NO_WAY
    return LEFT[BEHIND] if m2[OBSTACLES] < LEAST_M2 else BEHIND_OR_NO_WAY


def _add(found: dict[str, LeftFloor], reason: str, m2: float, marks: int = 0) -> LeftFloor:
    kind = found.setdefault(reason, LeftFloor(reason))
    kind.marks |= marks
    if kind.m2 is not None:
        kind.m2 += m2
    return kind
