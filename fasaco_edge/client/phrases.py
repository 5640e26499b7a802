"""Words for people: states, shares and times of a robot, and a log of what changes."""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from fasaco_edge.states import TROUBLED
from fasaco_edge.text import one_line, percent
from fasaco_edge.wire.documents.replies import (
    TROUBLES,
    CoverageReport,
    FloorReport,
    MissionReport,
    Reply,
    ZoneReport,
)
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import DriveReport, Status
from fasaco_edge.wire.reasons import plain, possible

# Offset of the wall clock from the monotonic clock when this module was imported [s].
_OFFSET_S = time.time() - time.monotonic()
# A time to go above this is an error, and is not shown [s].
LONGEST_S = 1e7


def covered(coverage: CoverageReport) -> str:
    """Return the covered share as text."""
    return f"{percent(coverage.fraction)}: {coverage.covered} of {coverage.coverable} cells"


def swept(floor: FloorReport) -> str:
    """Return the swept floor as text."""
    reached_m2, reachable_m2 = floor.reached_m2, floor.reachable_m2
    if reached_m2 is None or not reachable_m2:
        return f"{floor.swept_m2:.1f} m2"
    share = f"{percent(reached_m2 / reachable_m2)}: {reached_m2:.1f} of {reachable_m2:.1f} m2"
    if (possible_m2 := floor.possible_m2) is None:
        return share
    return share + possible(f"{possible_m2:.1f} m2")


def stage(mission: MissionReport) -> str:
    """Return the stage of a mission."""
    if mission.stage is None:
        return "no order"
    if mission.stage != "covering":
        return one_line(mission.stage)
    what = f"zone {one_line(mission.zone)}" if mission.zone else "everything reachable"
    kind = f", {one_line(mission.pass_kind)}" if mission.pass_kind else ""
    return f"{what}, pass {mission.pass_number} of {mission.passes}{kind}"


def zone_progress(zone: ZoneReport) -> tuple[str, str]:
    """Return the pass of a zone, and its progress."""
    at = f"{zone.pass_number} of {zone.passes}" if zone.pass_number else "to come"
    share = percent(zone.covered / zone.cells if zone.cells else 0.0)
    return at, f"{share}: {zone.covered} of {zone.cells} cells"


def time_to_go(status: Status) -> str:
    """Return the time that the rest of the path takes by the clock; "" if not known."""
    path = status.path
    if path is None or path.line_s is None or not path.remaining_steps:
        return ""
    # A simulation may be faster than real time.
    scale = known_settings(status.config).robot.time_scale
    return age(path.line_s / scale) if scale > path.line_s / LONGEST_S else ""


def scale_words(scale: float) -> str:
    """Return the speed of a simulation in words; "" for a real robot."""
    return "" if scale == 1.0 else f"simulated at {scale:g} times real time"


def figures(status: Status) -> str:
    """Return state and progress in a line that fits a terminal."""
    coverage, path, to_go = status.coverage, status.path, time_to_go(status)
    share = coverage and f"{percent(coverage.fraction)} of cells"
    floor = coverage and status.floor and f"{status.floor.swept_m2:.1f} m2 swept"
    number = path and path.steps and f"path {path.revision}"
    parts = one_line(status.state), share, floor, to_go and f"{to_go} to go", number
    return ", ".join(part for part in parts if part)


def drive(report: DriveReport) -> str:
    """Return the measured speeds of driving and of turning on the spot."""
    measured = (
        ("", report.speed_m_s, " m/s"),
        ("90 deg ", report.quarter_turn_s, " s"),
        ("180 deg ", report.half_turn_s, " s"),
    )
    words = [f"{name}{value:.2f}{unit}" for name, value, unit in measured if value is not None]
    return ", ".join(words) or "not measured yet"


def troubles(status: Status | Reply) -> list[tuple[str, str]]:
    """Return the troubles, their durations, and what to do about each."""
    return [
        (f"{one_line(each.text)} (for {age(each.since_s)})", one_line(each.do))
        for each in status.troubles[: len(TROUBLES)]
    ]


def reason(status: Status | Reply) -> str:
    """Return the state's reason; "" if it only repeats the path's number, or a trouble."""
    if re.fullmatch(r"path \d+", status.reason):
        return ""
    shown = (each.text for each in status.troubles[: len(TROUBLES)])
    return "" if status.reason in shown else one_line(plain(status.reason))


def steady_now() -> float:
    """Return the time since the epoch [s]; monotonic while this process runs."""
    return _OFFSET_S + time.monotonic()


def clock(at_s: float) -> str:
    """Return a time of ``steady_now`` as text, by the present setting of the wall clock."""
    wall_s = time.time() - (steady_now() - at_s)
    return time.strftime("%H:%M:%S", time.localtime(round(wall_s, 3)))


def age(seconds: float) -> str:
    """Return an elapsed time as text."""
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes, hours = seconds / 60, seconds / 3600
    return f"{minutes:.0f} min" if hours < 2 else f"{hours:.1f} h"


# Largest number of kept events.
KEPT = 200
# Tone of an entry.
PLAIN, GOOD, BAD, ORDER = "plain", "good", "bad", "order"


@dataclass(frozen=True, slots=True)
class Event:
    """An event: its time since the epoch [s], its text and its tone."""

    at_s: float
    text: str
    tone: str = PLAIN


class EventLog:
    """The newest entries, and the number of all entries."""

    def __init__(self) -> None:
        self.entries: deque[Event] = deque(maxlen=KEPT)
        self.count = 0

    def add(self, at_s: float, text: str, tone: str = PLAIN) -> None:
        """Add an event at ``at_s``, time since the epoch [s]."""
        self.entries.append(Event(at_s, one_line(plain(text)), tone))
        self.count += 1

    def since(self, count: int) -> list[Event]:
        """Return the kept entries after the first ``count``."""
        new = min(self.count - count, len(self.entries))
        return list(self.entries)[len(self.entries) - new :]


def differences(before: Status | None, after: Status) -> list[tuple[str, str]]:
    """Return the changes of a status, as (text, tone)."""
    found: list[tuple[str, str]] = []
    if before is None or before.state != after.state:
        tone = BAD if after.state in TROUBLED else GOOD if after.state == "done" else PLAIN
        found.append((f"{after.state}: {after.reason}", tone))
    elif after.state in TROUBLED and before.reason != after.reason:
        found.append((f"{after.state}: {after.reason}", BAD))
    found += trouble_changes(before, after)
    known = before.errors.by_code if before is not None else {}
    for code, count in after.errors.by_code.items():
        if more := count - known.get(code, 0):
            found.append((f"refused: {more} x {code}, {after.errors.last}", BAD))
    if after.ledger.fault and (before is None or before.ledger.fault != after.ledger.fault):
        found.append((f"ledger: {after.ledger.fault}", BAD))
    recorder = before.recorder.state if before is not None and before.recorder else ""
    if after.recorder and after.recorder.state != recorder:
        tone = PLAIN if after.recorder.state in ("recording", "starting") else BAD
        why = f": {after.recorder.reason}" if after.recorder.reason else ""
        found.append((f"recorder {after.recorder.state}{why}", tone))
    return found


def trouble_changes(before: Status | None, after: Status) -> Iterator[tuple[str, str]]:
    """Yield the troubles that began and ended, except a trouble that is the mission's reason."""
    known, present = (
        {each.code: each.text for each in (status.troubles if status else ())[: len(TROUBLES)]}
        for status in (before, after)
    )
    for code, text in present.items():
        if code not in known and text != after.reason:
            yield f"trouble: {text}", BAD
    for code in sorted(known.keys() - present.keys()):
        yield f"trouble is over: {known[code]}", GOOD
