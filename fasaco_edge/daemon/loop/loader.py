"""Loader: imports the planner and makes mission and planning thread, in a thread of its own.

Importing numba takes 60 MB, and compiling on a new machine takes many seconds, during which the
loop keeps replying.
"""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import TYPE_CHECKING

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.fleet_wing import company_of
from fasaco_edge.daemon.memory import floor_pixels
from fasaco_edge.host.processes import release_unused
from fasaco_edge.mission.config import MissionConfig, Sweeping
from fasaco_edge.mission.work.order_state import NO_ORDER, OrderState
from fasaco_edge.planners.compiling import compile_missing, warm_up
from fasaco_edge.planners.stages import stages_of_mission

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.planners.planner import CoveragePlanner


class Loader:
    """Imports the planner, warms its kernels up, and makes mission and worker, in a thread.

    Attributes:
        stage: the stage being loaded; "" once loading has ended, successful or not.
    """

    def __init__(self, config: DaemonConfig, mailbox: Mailbox[object]) -> None:
        self.stage = "importing"
        self._error: BaseException | None = None
        self._config = config
        self._mailbox = mailbox
        self._loaded: tuple[Mission, PlanningWorker] | None = None
        self._is_dropped = False
        threading.Thread(target=self._run, name="loader", daemon=True).start()

    def poll(self) -> tuple[Mission, PlanningWorker] | None:
        """Return the loaded mission and worker, None until then; raise the error of a failure."""
        if self._error is not None:
            raise self._error
        return self._loaded

    def drop(self) -> None:
        """End the worker, now or once it is loaded."""
        self._is_dropped = True
        if self._loaded is not None:
            self._loaded[1].disown()

    def _run(self) -> None:
        try:
            self._loaded = self._load()
            if self._is_dropped:
                self._loaded[1].disown()
        except BaseException as error:
            self._error = error
        self.stage = ""
        self._mailbox.post("loaded", None)

    def _load(self) -> tuple[Mission, PlanningWorker]:
        # Before the kernels are imported, as the import decides where they are loaded from.
        compile_missing(self._report)
        from fasaco_edge.daemon.loop.worker import PlanningWorker  # noqa: PLC0415
        from fasaco_edge.mission.core.mission import Mission  # noqa: PLC0415
        from fasaco_edge.planners.registry import planner_of  # noqa: PLC0415

        planner = self._config.planner
        has_fleet, has_curves = bool(self._config.fleet), self._config.robot.turn_radius_m > 0.0
        stages = stages_of_mission(planner.name, has_fleet=has_fleet, has_curves=has_curves)
        warm_up(self._report, stages)
        release_unused()
        chosen = planner_of(planner.name, planner.colony(), planner.threads)
        worker = PlanningWorker(chosen, planner.budget_s, self._mailbox.post)
        first = (
            OrderState.autostart() if self._config.mission.autostart else OrderState.idle(NO_ORDER)
        )
        config, kind = mission_config(self._config, chosen), company_of(self._config)
        return Mission(config, first, kind), worker

    def _report(self, stage: str) -> None:
        self.stage = f"kernels: {stage}"


def mission_config(config: DaemonConfig, chosen: CoveragePlanner) -> MissionConfig:
    """Return the configuration of a daemon's mission that ``chosen`` plans for."""
    from fasaco_edge.grid.lattice import Footprint  # noqa: PLC0415
    from fasaco_edge.planners.living_trail import TrailRules  # noqa: PLC0415
    from fasaco_edge.planners.search.near_optimal import NearOptimal  # noqa: PLC0415

    robot, maps, planner, cell_m = config.robot, config.map, config.planner, config.cell_m
    return MissionConfig(
        Footprint(cell_m, robot.radius_m, maps.free_at_most, maps.occupied_at_least),
        maps.max_lattice_cells,
        robot.cost(cell_m),
        config.mission,
        planner.spare_share if isinstance(chosen, NearOptimal) else 0.0,
        _sweeping(config),
        TrailRules(planner.alpha, planner.tau0),
        battery=config.battery or None,
        lattice_deg=config.lattice_deg,
        speed_m_s=robot.speed_m_s,
    )


def _sweeping(config: DaemonConfig) -> Sweeping | None:
    from fasaco_edge.planners.line import LINES  # noqa: PLC0415

    robot, line = config.robot, LINES.get(config.planner.line)
    if line is None:
        return None
    speed_m_s, turning = robot.speed_m_s, robot.turning()
    line = replace(line, speed_m_s=speed_m_s, turning=turning, swept=config.planner.swept)
    most_pixels = floor_pixels(config.map.max_pixels)
    return Sweeping(
        robot.tool_width_m,
        most_pixels,
        line,
        robot.tool_ahead_m,
        robot.clearance_m,
        robot.curves(line.price_s_m2),
    )
