"""View of a fleet from its robots' messages: their activities, and the latest events."""

from __future__ import annotations

import math
import time
from collections import Counter
from dataclasses import dataclass

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.phrases import BAD, GOOD, PLAIN, EventLog
from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.observer.observed import JOINED, MOST_MEMBERS, ObservedFleet, ObservedRobot
from fasaco_edge.fleet.observer.queues import RobotSample
from fasaco_edge.fleet.observer.survey import Survey, survey_of
from fasaco_edge.states import TROUBLED, Activity, states_of
from fasaco_edge.text import is_reported, one_line
from fasaco_edge.wire.documents.fleet import decode_member, fleet_of
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import FleetReport, Status
from fasaco_edge.wire.keys import is_chunk
from fasaco_edge.wire.reasons import plain

# Least time between two notes of a robot's state [s].
NOTED_EVERY_S = 1.0
# Least time between two surveys of the floor: in [s], and as a multiple of a survey's duration.
LEAST_AGE_S, LEAST_REST = 1.0, 10.0
# A robot without messages to this watch is named if others received one within this time [s].
RECENT_S = 600.0
# Number of robots and topics whose faults are counted separately; number of other fleets named.
MOST_FAULTS, MOST_FLEETS = 256, 32
# States of a robot that does something for its mission.
AT_WORK = states_of(Activity.DRIVING)
# Longest text of a robot that shares a line with other texts [characters].
LONGEST = 40


@dataclass(frozen=True, slots=True)
class FleetRobot:
    """A robot of the fleet at one time.

    Attributes:
        member: the robot, with its last message.
        name: name of the robot.
        state: state of its mission, in its last message; one line.
        waits_for: name of the robot that it waits for; "" for none.
        silent_s: time since its last message if it is gone [s]; else None.
        away: why others give it no part of the remaining cells; "" if they do.
        swept_cells: number of cells that it has swept.
        left_cells: number of cells left in its part; None without a division.
        cell_m2: area of its cells [m2].
        revision: number of its path; None if not known.
    """

    member: ObservedRobot
    name: str
    state: str
    waits_for: str
    silent_s: float | None
    away: str
    swept_cells: int
    left_cells: int | None
    cell_m2: float
    revision: int | None

    @property
    def is_at_work(self) -> bool:
        """Whether the robot does something for its mission."""
        return self.silent_s is None and self.state in AT_WORK

    @property
    def doing(self) -> str:
        """The robot's activity in a few words."""
        if self.silent_s is not None:
            return "gone"
        return f"waits for {self.waits_for}" if self.waits_for else self.state or "no state"

    def document(self) -> dict[str, object]:
        """Return the robot as ``--json`` prints it."""
        said = self.member.newest
        x, y = self.member.placed(said.x, said.y)
        return {
            "name": self.name,
            "state": "gone" if self.silent_s is not None else self.state,
            "x": round(x, 3),
            "y": round(y, 3),
            "waits_for": self.waits_for,
            "away": self.away or None,
            "division": said.division,
            "swept_cells": self.swept_cells,
            "swept_m2": round(self.swept_cells * self.cell_m2, 2),
            "part_cells": self.left_cells,
            "path": self.revision,
        }


def short(text: str) -> str:
    """Return a text from a robot as one short line."""
    line = one_line(text)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."


@dataclass(slots=True)
class _RobotNews:
    status: Status | None = None
    noted: str = ""
    noted_at: float = -math.inf


class FleetView:
    """The newest data of all robots of one fleet, and the latest events.

    Attributes:
        fleet: name of the fleet.
        members: its robots.
        events: the latest events.
        trouble: why the bus cannot be reached; "" if it can.
        floor: the cells of all robots.
        others: names of other fleets on the bus, one line each.
    """

    def __init__(self, fleet: str) -> None:
        self.fleet = fleet
        self.members = ObservedFleet()
        self.events = EventLog()
        self.trouble = ""
        self.others: set[str] = set()
        self._seen: dict[str, _RobotNews] = {}
        self.floor, self._floor_key, self._floor_due_at = Survey(), object(), 0.0
        self._division = 0
        self._faults: Counter[tuple[str, str]] = Counter()

    def take(self, received: RobotSample) -> None:
        """Take in a sample; an unreadable sample is dropped and noted."""
        arrival, robot = received.arrival, received.robot
        try:
            if arrival.topic == "fleet":
                self._read_fleet(robot, arrival.sample, arrival.wall_ns)
            elif (member := self.members.get(robot)) is not None:
                self._read_status(member, arrival.sample)
        except FasacoError as error:
            text = f"{arrival.topic} cannot be read: {error}"
            self._note_often(robot, arrival.topic, text, 1e-9 * arrival.wall_ns)

    def tick(self, now: float) -> None:
        """Note changes up to ``now``, time since the epoch [s]; to be called often."""
        now_ns = int(1e9 * now)
        divider = self.members.dividing(now_ns)
        self._look_at_floor(divider, now_ns)
        if divider is not None and divider.newest.division != self._division:
            self._division = divider.newest.division
            among = f", {len(divider.newest.parts)} parts" if divider.newest.parts else ""
            self.events.add(now, f"division {self._division} by {short(divider.newest.by)}{among}")
        for robot in self.robots(now):
            self._note_state(robot, now)

    def _look_at_floor(self, divider: ObservedRobot | None, now_ns: int) -> None:
        division = None if divider is None else (divider.name, divider.newest.division)
        key = division, *((member.name, member.changes) for member in self.members)
        began = time.monotonic()
        if key == self._floor_key or began < self._floor_due_at:
            return
        self._floor_key, self.floor = key, survey_of(self.members, now_ns)
        took_s = time.monotonic() - began
        self._floor_due_at = began + max(LEAST_AGE_S, (1.0 + LEAST_REST) * took_s)

    def names(self) -> list[str]:
        """Return the names of the robots."""
        return [member.name for member in self.members]

    def unheard(self, now: float) -> list[str]:
        """Return the names of robots that sent to other robots recently, but not to this watch."""
        named = {
            other.name
            for status in self._reports(int(1e9 * now)).values()
            for other in status.members
            if other.heard_s <= RECENT_S and is_chunk(other.name)
        }
        return sorted(map(short, named - set(self._seen)))[:MOST_MEMBERS]

    def robots(self, now: float) -> list[FleetRobot]:
        """Return the robots by name."""
        now_ns = int(1e9 * now)
        away = self._absences(now_ns)
        found = [self._robot(member, away.get(member.name, ""), now) for member in self.members]
        return sorted(found, key=lambda robot: robot.name)

    def document(self, now: float) -> dict[str, object]:
        """Return the document that ``--json`` prints."""
        floor, robots = self.floor, self.robots(now)
        return {
            "fleet": self.fleet,
            "at_work": sum(robot.is_at_work for robot in robots),
            "division": self._division,
            "cells": floor.area,
            "swept_cells": floor.swept,
            "swept_twice_cells": int(floor.twice.sum()),
            "swept_m2": round(floor.swept * floor.cell_m2, 2),
            "fraction": None if floor.fraction is None else round(floor.fraction, 4),
            "robots": [robot.document() for robot in robots],
            "unheard": self.unheard(now),
        }

    def _robot(self, member: ObservedRobot, away: str, now: float) -> FleetRobot:
        said, status = member.newest, self._seen[member.name].status
        is_gone = member.is_gone(int(1e9 * now))
        return FleetRobot(
            member=member,
            name=member.name,
            state=short(said.state),
            waits_for=short(said.waits_for),
            silent_s=now - 1e-9 * member.received_ns if is_gone else None,
            away=away,
            swept_cells=member.swept.count,
            left_cells=self.floor.left.get(member.name) if self.floor.division else None,
            cell_m2=member.seat.cell_m**2,
            revision=status.path.revision if status and status.path else None,
        )

    def _reports(self, now_ns: int) -> dict[str, FleetReport]:
        """Return the fleet reports of present robots, by their names."""
        found = {}
        for member in self.members:
            status = self._seen[member.name].status
            if not member.is_gone(now_ns) and status is not None and status.fleet is not None:
                found[member.name] = status.fleet
        return found

    def _absences(self, now_ns: int) -> dict[str, str]:
        """Return why others give robots no part, by the names of these robots."""
        return {
            other.name: short(other.away)
            for report in self._reports(now_ns).values()
            for other in report.members
            if other.away and other.name in self._seen
        }

    def _read_fleet(self, robot: str, sample: Sample, at_ns: int) -> None:
        said = decode_member(sample.payload, self.fleet)
        if said is None or not robot:
            if not self._seen and len(self.others) < MOST_FLEETS:
                self.others |= {short(fleet_of(sample.payload) or "")} - {""}
            return
        _, news = self.members.receive(robot, said, at_ns)
        if news == JOINED:
            self._seen[robot] = _RobotNews()
        elif news:
            self._note_often(robot, "frame", news, 1e-9 * at_ns)

    def _read_status(self, member: ObservedRobot, sample: Sample) -> None:
        status = decode_tolerant(sample.payload, Status)
        # A second daemon with the robot's name does not plan.
        if status.claim.stand == "plans":
            self._seen[member.name].status = status

    def _note_state(self, robot: FleetRobot, now: float) -> None:
        seen, doing = self._seen[robot.name], robot.doing
        if doing == seen.noted or now - seen.noted_at < NOTED_EVERY_S:
            return
        before, seen.noted, seen.noted_at = seen.noted, doing, now
        name, status = short(robot.name), seen.status
        if doing == "gone":
            self.events.add(now, f"{name} is gone: no messages from it", BAD)
            return
        name += {"": " joined", "gone": " is back"}.get(before, "")
        is_troubled = not robot.waits_for and robot.state in TROUBLED
        why = f": {short(plain(status.reason))}" if is_troubled and status is not None else ""
        is_good = doing == "done" or before in ("", "gone")
        tone = BAD if is_troubled else GOOD if is_good else PLAIN
        self.events.add(now, f"{name}: {doing}{why}", tone)

    def _note_often(self, robot: str, what: str, text: str, now: float) -> None:
        """Note the 1st, 2nd, 4th, 8th ... occurrence of an event that may repeat."""
        fault = robot, what
        if fault not in self._faults and (
            robot not in self._seen or len(self._faults) >= MOST_FAULTS
        ):
            # Invented names must not fill the memory.
            fault = "other robots", what
        self._faults[fault] += 1
        count = self._faults[fault]
        if is_reported(count):
            again = f" ({count} so far)" if count > 1 else ""
            self.events.add(now, f"{short(fault[0])}: {text}{again}", BAD)
