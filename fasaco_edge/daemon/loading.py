"""Kernels come with the first map: until then the daemon is small.

Importing numba costs 60 MB, and compiling on a new machine takes many seconds;
both happen in a thread of their own, so that the loop keeps answering.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.process_memory import release_unused

if TYPE_CHECKING:
    from fasaco_edge.daemon.worker import PlanningWorker
    from fasaco_edge.mission.mission import Mission


class Loader:
    """Imports what plans, warms the kernels up, and sets up mission and worker."""

    def __init__(self, config: DaemonConfig, mailbox: Mailbox[object]) -> None:
        self.stage = "importing"
        self.error: BaseException | None = None
        self._config = config
        self._mailbox = mailbox
        self._loaded: tuple[Mission, PlanningWorker] | None = None
        self._is_dropped = False
        threading.Thread(target=self._run, name="loader", daemon=True).start()

    def poll(self) -> tuple[Mission, PlanningWorker] | None:
        """Return what was loaded, None until then; raise what went wrong."""
        if self.error is not None:
            raise self.error
        return self._loaded

    @property
    def is_done(self) -> bool:
        """Whether all is loaded, or went wrong."""
        return self._loaded is not None or self.error is not None

    def drop(self) -> None:
        """Let the worker go, now or once it is there: nobody will ask for it."""
        self._is_dropped = True
        if self._loaded is not None:
            self._loaded[1].disown()

    def _run(self) -> None:
        try:
            self._loaded = self._load()
            if self._is_dropped:
                self._loaded[1].disown()
        except BaseException as error:
            self.error = error
        self._mailbox.post("loaded", None)

    def _load(self) -> tuple[Mission, PlanningWorker]:
        from fasaco_edge.daemon.worker import PlanningWorker  # noqa: PLC0415
        from fasaco_edge.grid.lattice import Footprint  # noqa: PLC0415
        from fasaco_edge.mission.assignment import NO_ORDER, Assignment  # noqa: PLC0415
        from fasaco_edge.mission.config import MissionConfig  # noqa: PLC0415
        from fasaco_edge.mission.mission import Mission  # noqa: PLC0415
        from fasaco_edge.planners.near_optimal import NearOptimal  # noqa: PLC0415
        from fasaco_edge.planners.table import planner_of  # noqa: PLC0415
        from fasaco_edge.planners.warmup import warm_up  # noqa: PLC0415

        warm_up(self._report)
        release_unused()
        robot, maps, planner = self._config.robot, self._config.map, self._config.planner
        footprint = Footprint(
            robot.tool_width_m, robot.radius_m, maps.free_at_most, maps.occupied_at_least
        )
        chosen = planner_of(planner.name, planner.colony(), planner.threads, planner.local_search)
        worker = PlanningWorker(chosen, planner.budget_s, self._mailbox.post)
        patience = self._config.mission
        mission = MissionConfig(
            footprint,
            maps.max_lattice_cells,
            robot.cost(),
            retries=patience.retries,
            retry_s=patience.retry_s,
            lost_pose_s=patience.lost_pose_s,
            stale_map_s=patience.stale_map_s,
            spare_share=planner.spare_share if isinstance(chosen, NearOptimal) else 0.0,
        )
        first = Assignment.by_itself() if patience.autostart else Assignment.none(NO_ORDER)
        return Mission(mission, first), worker

    def _report(self, stage: str) -> None:
        self.stage = f"kernels: {stage}"
