"""What of an order is left uncovered on the map as it is: found out anew when something changed."""

from __future__ import annotations

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.assignment import Assignment, Stage
from fasaco_edge.mission.ground import Ground
from fasaco_edge.mission.logbook import Logbook
from fasaco_edge.mission.order import MissionOrder
from fasaco_edge.mission.site import Site
from fasaco_edge.mission.unreached import Sighted, Situation, Unreached, viewpoints
from fasaco_edge.mission.zones import in_zones


class Leftovers:
    """Remembers what could be reached since an order began.

    Attributes:
        failures: paths after which cells were left over.
    """

    def __init__(self, site: Site, log: Logbook) -> None:
        self.failures = 0
        self._site = site
        self._log = log
        self._sighted: Sighted | None = None
        self._seen: Ground | None = None
        self._found: tuple[object, Unreached] = (None, Unreached())

    def begin_anew(self) -> None:
        """Begin with another order."""
        self.failures, self._sighted, self._seen = 0, None, None
        self.see()

    def see(self) -> None:
        """Remember what can be reached now."""
        ground, before = self._site.ground, self._sighted
        if ground is not None and ground is not self._seen:
            self._sighted = before.and_now(ground) if before else Sighted.of(ground)
            self._seen = ground

    def unreached(self, assignment: Assignment) -> Unreached:
        """Return what is not reached.

        While the robot stands where it cannot be, what was so before is all there is to say.
        """
        ground = self._site.ground
        if assignment.order is None:
            return Unreached()
        key = (ground, self._log.ledger.total, assignment)
        if ground is not None and key != self._found[0]:
            given_up = assignment.stage is not Stage.COVERING
            self._found = key, self._situation(assignment.order, ground, given_up).unreached()
        return self._found[1]

    def viewpoints(self, order: MissionOrder, ground: Ground) -> set[Cell]:
        """Return the cells (row, col) to look at areas from that were closed."""
        window = ground.lattice.window
        situation = self._situation(order, ground, given_up=True)
        found = viewpoints(situation.closed(), ground.reachable)
        return {(row + window.row0, col + window.col0) for row, col in found}

    def _situation(self, order: MissionOrder, ground: Ground, given_up: bool) -> Situation:
        window = ground.lattice.window
        assert self._site.free is not None
        uncovered = in_zones(order.zones, window, ground.lattice.cell_m)
        return Situation(
            free=self._site.free,
            ground=ground,
            uncovered=uncovered & (self._log.ledger.visits(window) == 0),
            sighted=self._sighted.on(window) if self._sighted else ground.reachable,
            zoned=order.zones[0].polygon is not None,
            given_up=given_up,
            tries=self.failures,
        )
