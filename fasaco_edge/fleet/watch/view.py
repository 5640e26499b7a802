"""The view of a fleet from its robots' messages: their activities, and the latest events."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from dataclasses import dataclass, field

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.events import BAD, GOOD, PLAIN, TROUBLED, EventLog
from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.observer.inbox import Received
from fasaco_edge.fleet.observer.members import JOINED, MOST_MEMBERS, Member, Members
from fasaco_edge.fleet.observer.survey import Survey, survey_of
from fasaco_edge.fleet.watch.robot import FleetRobot, document_of, short
from fasaco_edge.text import is_reported
from fasaco_edge.wire.documents.fleet import decode_member, fleet_of
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import FleetReport, Status
from fasaco_edge.wire.keys import is_chunk
from fasaco_edge.wire.reasons import plain

# Least time between two notes of a robot's state [s]; time over which its rate is averaged [s].
NOTED_EVERY_S, RATE_S = 1.0, 5
# Least time between two surveys of the floor [s]; and as a multiple of the time that one takes.
LEAST_AGE_S, LEAST_REST = 1.0, 10.0
# Robots that others received messages from within this time are named, even if silent here [s].
RECENT_S = 600.0
# Number of robots and topics whose faults are counted apart; of other fleets that are named.
MOST_FAULTS, MOST_FLEETS = 256, 32


@dataclass(slots=True)
class _Seen:
    """Data of a robot besides its fleet messages."""

    status: Status | None = None
    noted: str = ""
    noted_at: float = -math.inf
    rates: deque[float] = field(default_factory=lambda: deque(maxlen=RATE_S))


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
        self.members: Members[Member] = Members(Member)
        self.events = EventLog()
        self.trouble = ""
        self.others: set[str] = set()
        self._seen: dict[str, _Seen] = {}
        self.floor, self._floor_key, self._floor_due_at = Survey(), object(), 0.0
        self._division = 0
        self._faults: Counter[tuple[str, str]] = Counter()

    def take(self, received: Received) -> None:
        """Take in a sample. One that cannot be read is dropped and noted."""
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
        """Note changes up to ``now``, since the epoch [s]; call it often."""
        now_ns = int(1e9 * now)
        divider = self.members.dividing(now_ns)
        self._look_at_floor(divider, now_ns)
        if divider is not None and divider.newest.division != self._division:
            self._division = divider.newest.division
            among = f", {len(divider.newest.parts)} parts" if divider.newest.parts else ""
            self.events.add(now, f"division {self._division} by {short(divider.newest.by)}{among}")
        for robot in self.robots(now):
            self._note_state(robot, now)

    def _look_at_floor(self, divider: Member | None, now_ns: int) -> None:
        """Survey the floor after changes, if that is due."""
        division = None if divider is None else (divider.name, divider.newest.division)
        key = division, *((member.name, member.changes) for member in self.members)
        began = time.monotonic()
        if key == self._floor_key or began < self._floor_due_at:
            return
        self._floor_key, self.floor = key, survey_of(self.members, now_ns)
        took_s = time.monotonic() - began
        self._floor_due_at = began + max(LEAST_AGE_S, (1.0 + LEAST_REST) * took_s)

    def note_rate(self, robot: str, kb_s: float) -> None:
        """Note a robot's rate of fleet messages in the last second [kB/s]."""
        if robot in self._seen:
            self._seen[robot].rates.append(kb_s)

    def names(self) -> list[str]:
        """Return the names of the robots."""
        return [member.name for member in self.members]

    def unheard(self, now: float) -> list[str]:
        """Return the names of robots that others received lately, but this observer did not."""
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
        document = document_of(self.fleet, self._division, self.floor, self.robots(now))
        return document | {"unheard": self.unheard(now)}

    def _robot(self, member: Member, away: str, now: float) -> FleetRobot:
        said, seen, cell_m2 = member.newest, self._seen[member.name], member.seat.cell_m**2
        x, y = member.placed(said.x, said.y)
        floor, is_gone = self.floor, member.is_gone(int(1e9 * now))
        left = floor.left.get(member.name) if floor.division else None
        path = seen.status.path if seen.status is not None else None
        return FleetRobot(
            name=member.name,
            state=short(said.state),
            waits_for=short(said.waits_for),
            silent_s=now - 1e-9 * member.received_ns if is_gone else None,
            away=away,
            x=x,
            y=y,
            swept_cells=member.swept.count,
            swept_m2=member.swept.count * cell_m2,
            left_cells=left,
            left_m2=None if left is None else left * floor.cell_m2,
            division=said.division,
            revision=None if path is None else path.revision,
            kb_s=sum(seen.rates) / len(seen.rates) if seen.rates else 0.0,
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
            # The place may have belonged to a robot long gone.
            self._seen = {name: self._seen.get(name, _Seen()) for name in self.names()}
        elif news:
            self._note_often(robot, "frame", news, 1e-9 * at_ns)

    def _read_status(self, member: Member, sample: Sample) -> None:
        status = decode_tolerant(sample.payload, Status)
        # A second daemon of the robot's name does not plan.
        if status.claim.stand == "plans":
            self._seen[member.name].status = status

    def _note_state(self, robot: FleetRobot, now: float) -> None:
        """Note a robot's activity if it has changed."""
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
            # Bounded, as there may be any number of names.
            fault = "other robots", what
        self._faults[fault] += 1
        count = self._faults[fault]
        if is_reported(count):
            again = f" ({count} so far)" if count > 1 else ""
            self.events.add(now, f"{short(fault[0])}: {text}{again}", BAD)
