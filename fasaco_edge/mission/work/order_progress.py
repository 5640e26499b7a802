"""Progress of an order: its zone, pass and stage, now and next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Self

from fasaco_edge.mission.map.configured_places import NO_PLACES, PlacesNote
from fasaco_edge.mission.orders.keep_outs import KeepOuts
from fasaco_edge.mission.orders.order import Errand, MissionOrder, Zone
from fasaco_edge.mission.rooms.room_book import MOST_LISTED
from fasaco_edge.mission.work.reached_cells import ReachedCells
from fasaco_edge.planners.passes import Laid


class Stage(StrEnum):
    """Phase of an order."""

    COVERING = "covering"
    RETRYING = "retrying"
    RETURNING = "returning"
    OVER = "over"


@dataclass(frozen=True, slots=True)
class OrderProgress:
    """An order and its progress.

    Attributes:
        order: what to cover; None for none.
        automatic: whether it began without a command, and continues whenever the map shows more.
        stage: phase: covering zones pass by pass, then retrying cells left over, then driving home.
        zone: index of the zone.
        pass_number: number of the pass over it, from 1.
        begun: whether that pass has begun.
        tries: number of retries so far.
        home: cell (row, col) where the first order since a reset or a change of map began.
        paused: whether the robot must stand.
        errand: destination to drive to before the order continues.
        why: why there is no order, why it is paused, or how it ended.
        frame: frame of the map that zones, keep-out zones and home were given for; "" while no
            frame is in use.
        places: which map the places of the configuration belong to.
        keep_out: keep-outs of the operator, which apply to any order.
        reached: cells that have been reachable since the order began; set only in the ledger's
            file, None in a mission.
        spent_s: the robot's time since the order began, if it has a limit [s].
        late: why it ends before all is covered; "" if it does not.
        last: the order that was cancelled, until another begins; None for none.
    """

    order: MissionOrder | None = None
    automatic: bool = False
    stage: Stage = Stage.COVERING
    zone: int = 0
    pass_number: int = 1
    begun: bool = False
    tries: int = 0
    home: tuple[int, int] | None = None
    paused: bool = False
    errand: Errand = ""
    why: str = ""
    frame: str = ""
    places: PlacesNote = NO_PLACES
    keep_out: KeepOuts = ()
    reached: ReachedCells | None = None
    spent_s: float = field(default=0.0, compare=False)
    late: str = ""
    last: MissionOrder | None = field(default=None, compare=False)

    @property
    def current_zone(self) -> Zone | None:
        """The zone being covered; None for none."""
        if self.order is None or self.stage is not Stage.COVERING:
            return None
        return self.order.zones[self.zone]

    @property
    def waits_for(self) -> str:
        """Name of the room that the present zone waits for; "" for none."""
        zone = self.current_zone
        return zone.name if zone is not None and zone.polygon == () else ""

    @property
    def current_pass(self) -> Laid:
        """The present pass, with its lanes on a lattice."""
        zone = self.current_zone
        return Laid() if zone is None else zone.laid(self.pass_number)

    @property
    def speed_m_s(self) -> float | None:
        """Speed to drive at [m/s]; None for the robot's usual speed."""
        zone = self.current_zone
        return None if zone is None or self.errand else zone.kind(self.pass_number).speed_m_s

    @property
    def title(self) -> str:
        """Zone and pass as text."""
        zone = self.current_zone
        if zone is None:
            return str(self.stage)
        name = "everything reachable" if zone.polygon is None else f"zone {zone.name!r}"
        number = "" if zone.passes == 1 else f"pass {self.pass_number} of {zone.passes}"
        return ", ".join(filter(None, (name, number, zone.kind(self.pass_number).name)))

    @property
    def returns_home_next(self) -> bool:
        """Whether this is the last zone and pass before returning home."""
        return self.order is not None and self.order.return_home and self.next_pass() is self

    def next_pass(self) -> Self:
        """Return the state in the next pass or zone; the same state after the last."""
        if self.order is None or self.stage is not Stage.COVERING:
            return self
        if self.pass_number < self.order.zones[self.zone].passes:
            return replace(self, pass_number=self.pass_number + 1, begun=False)
        if self.zone + 1 < len(self.order.zones):
            return replace(self, zone=self.zone + 1, pass_number=1, begun=False)
        return self

    @property
    def is_open(self) -> bool:
        """Whether there is an order with work left."""
        goes_on = self.automatic and not self.late
        return self.order is not None and (self.stage is not Stage.OVER or goes_on)

    @property
    def has_begun(self) -> bool:
        """Whether the robot has begun with the order."""
        is_first = self.zone == 0 and self.pass_number == 1 and self.stage is Stage.COVERING
        return self.order is not None and (self.begun or not is_first)

    def by_priority(self) -> Self:
        """Return the state with present and later zones by priority, highest first.

        Zones that wait for a room stay last.
        """
        assert self.order is not None
        given, zones = self.order.as_given, self.order.zones
        to_come = sorted(
            range(self.zone, len(zones)), key=lambda at: (zones[at].polygon == (), -zones[at].worth)
        )
        sequence = [*range(self.zone), *to_come]
        order = replace(self.order, zones=tuple(zones[at] for at in sequence))
        if given is not self.order:
            given = replace(given, zones=tuple(given.zones[at] for at in sequence))
            order = replace(order, given=given)
        return replace(self, order=order)

    def out_of_time(self, minutes: float) -> Self:
        """Return the state of an order that ends at its time limit [min]."""
        late = f"time is up after {minutes:g} min"
        if self.order is not None and self.stage is Stage.COVERING:
            zone, to_come = self.order.zones[self.zone], self.order.zones[self.zone + 1 :]
            late += f" in {self.title}" if zone.polygon or zone.passes > 1 else ""
            names = ", ".join(repr(each.name) for each in to_come)
            late += f", before {names:.{MOST_LISTED}}" if names else ""
        return replace(self, stage=Stage.RETURNING, begun=False, late=late)
