"""Report of a fleet in a robot's status: its division, and the other robots."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fasaco_edge.fleet.mission.kind import fleet_of
from fasaco_edge.wire.documents.status import FleetReport, MemberReport

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission


def report(fleet: str, mission: Mission | None, now: float) -> FleetReport:
    """Return the report of the fleet of this name at ``now`` [s]."""
    if mission is None:
        return FleetReport(fleet)
    others = fleet_of(mission)
    members = tuple(
        MemberReport(
            name,
            member.newest.state,
            round(max(now - member.heard_at, 0.0), 1),
            member.absence(now) or None,
            others.shared.cells_of(name),
        )
        for name, member in sorted(others.members.items())
    )
    return FleetReport(fleet, others.numbers.number, others.part_cells(), members)
