"""Kind of company: factory for the parts of a mission that handle other robots."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fasaco_edge.mission.company import Company, Waiting
from fasaco_edge.mission.coverage.others_cells import OthersCells

if TYPE_CHECKING:
    # For types only: an idle daemon loads no kernels.
    from fasaco_edge.mission.config import MissionConfig
    from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
    from fasaco_edge.mission.map.map_state import MapState
    from fasaco_edge.mission.path.route import Route
    from fasaco_edge.mission.work.sequencer import Sequencer


class CompanyKind:
    """The factory for a single robot; a fleet has its own."""

    def cells(self) -> OthersCells:
        """Return the cells that others have swept."""
        return OthersCells()

    def company(self, config: MissionConfig, map_state: MapState, ledger: MissionLedger) -> Company:
        """Return the mission's interface to the other robots."""
        return Company()

    def waiting(
        self,
        config: MissionConfig,
        map_state: MapState,
        orders: Sequencer,
        route: Route,
        company: Company,
    ) -> Waiting:
        """Return the part that decides when the robot waits for others."""
        return Waiting()


ALONE = CompanyKind()
