"""Plans of several passes over a map, each begun where the previous one ends; their figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np
from PIL import Image

from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.judge.floor import FloorFigures
from fasaco_edge.offline.figures import floor_document, floor_words, judged_floor
from fasaco_edge.offline.ground import Line
from fasaco_edge.offline.maps import Map
from fasaco_edge.offline.plan import plan
from fasaco_edge.offline.result import Drive, Plan, picture_of, png_of, saved
from fasaco_edge.offline.settings import ANYWHERE, CELLS, HOME, Search
from fasaco_edge.planners.passes import Pass, laid, read_pass
from fasaco_edge.planners.planner import SearchProgress, StoppingCriterion


@dataclass(frozen=True, repr=False)
class PassPlans:
    """Passes over a map, one plan each.

    Attributes:
        passes: the passes.
        plans: their plans, in order.
    """

    passes: tuple[Pass, ...]
    plans: tuple[Plan, ...]

    def __repr__(self) -> str:
        """Return the passes in one line, without their plans."""
        swept = "" if self.floor is None else f": {floor_words(self.floor)}"
        name = self.plans[0].map.name
        return f"<PassPlans {name}, {', '.join(self.names)}{swept}, {self.drive.time}>"

    def _repr_png_(self) -> bytes:
        return png_of(self.plot())

    @property
    def names(self) -> list[str]:
        """Name of each pass."""
        return [each.name or "auto" for each in self.passes]

    @cached_property
    def xy(self) -> Line:
        """The line over all passes, float64 (n, 2): points (x, y) [m] in the map frame."""
        return np.concatenate([plan.xy for plan in self.plans])

    @property
    def cost_s(self) -> float:
        """Time to drive and turn along all walks' cells [s]; the lines have ``drive.seconds``."""
        return math.fsum(plan.cost_s for plan in self.plans)

    @property
    def drive(self) -> Drive:
        """The effort of driving the lines: sums over the passes, without a gap."""
        drives = [plan.drive for plan in self.plans]
        metres, turns, seconds = (
            math.fsum(getattr(drive, name) for drive in drives)
            for name in ("metres", "turns", "seconds")
        )
        return Drive(metres, turns, seconds, None, drives[0].counts_turns)

    @cached_property
    def floor(self) -> FloorFigures | None:
        """Figures of the floor that the whole line sweeps; None for a coverage grid."""
        first = self.plans[0]
        judged = judged_floor(first.map.grid, self.xy, first.robot)
        if judged is None:
            return None
        # Each pass has its own speed; a lower bound of the time is only known for single passes.
        seconds, swept_m2 = self.drive.seconds, judged.figures.swept_m2
        each = seconds / swept_m2 if swept_m2 else None
        return replace(judged.figures, least_s=0.0, seconds=seconds, seconds_per_m2=each)

    @property
    def figures(self) -> dict[str, object]:
        """All figures of ``fasaco-edge plan --json`` as JSON values."""
        first = self.plans[0]
        return {
            "map": first.map.name,
            "line": first.line,
            "steps": sum(plan.steps for plan in self.plans),
            "length_m": round(
                math.fsum(plan.steps * plan.problem.lattice.cell_m for plan in self.plans), 3
            ),
            "cost_s": self.cost_s,
            "wall_s": round(math.fsum(plan.wall_s for plan in self.plans), 6),
            "floor": floor_document(self.floor),
            "passes": [
                {"pass": name} | plan.figures
                for name, plan in zip(self.names, self.plans, strict=True)
            ],
        }

    def plot(self, file: str | Path | None = None) -> Image.Image:
        """Return an RGB picture of the passes side by side; also write it to ``file`` as PNG."""
        count, pairs = len(self.plans), zip(self.names, self.plans, strict=True)
        pictures = [
            picture_of(plan, f"pass {number} of {count}, {name}: ")
            for number, (name, plan) in enumerate(pairs, 1)
        ]
        size = sum(each.width for each in pictures), max(each.height for each in pictures)
        picture, left = Image.new("RGB", size, "white"), 0
        for each in pictures:
            picture.paste(each, (left, 0))
            left += each.width
        return saved(picture, file)


def plan_passes(
    map: Map,
    robot: RobotConfig | None = None,
    passes: Sequence[str | Pass] = ("auto",),
    *,
    start: Cell | None = None,
    start_xy: tuple[float, float] | None = None,
    end: str | Cell = ANYWHERE,
    line: str | None = None,
    align: str | float | None = None,
    search: Search | None = None,
    stop: StoppingCriterion | None = None,
    watch: Callable[[SearchProgress], None] = lambda _: None,
) -> PassPlans:
    """Plan several passes over a map, each begun where the previous one ends.

    Args:
        map, robot, start, start_xy, line, align, search, stop, watch: see ``plan``; each pass has
            the whole budget.
        passes: what each covers, and the direction of its lanes: "edge", "rest", "auto", "cross",
            an angle as "30deg", "rest:cross", "cross%30@0.15" with an overlap [percent] and a
            speed [m/s]; or a ``Pass``.
        end: where the last pass ends: "anywhere", "home", or a cell.

    Raises:
        BadConfiguration: a value is invalid; ``plan`` raises further errors.
    """
    robot = RobotConfig() if robot is None else robot
    if robot.turn_radius_m > 0.0:
        raise BadConfiguration(
            "several passes are only planned for a robot that turns on the spot",
            hint="plan each pass separately; a mission drives one after the other",
        )
    is_list = isinstance(passes, Sequence) and not isinstance(passes, str) and len(passes) > 0
    if not is_list or not all(isinstance(each, str | Pass) for each in passes):
        such = passes.split(",") if passes and isinstance(passes, str) else ["edge", "auto"]
        raise BadConfiguration(f"passes must be a list such as {such}, got {passes!r}")
    asked = tuple(read_pass(each) if isinstance(each, str) else each for each in passes)
    plans: list[Plan] = []
    for index, (each, lay) in enumerate(zip(asked, laid(asked), strict=True)):
        is_last = index == len(asked) - 1
        if plans and line == CELLS:
            row, col = plans[-1].cells[-1].tolist()
            start, start_xy = (row, col), None
        elif plans:
            x, y = plans[-1].xy[-1].tolist()
            start, start_xy = None, (x, y)
        planned = plan(
            map,
            _robot_in(each, robot),
            start=start,
            start_xy=start_xy,
            end=_end(end, plans) if is_last else ANYWHERE,
            line=line,
            align=align if lay.angle_deg is None else lay.angle_deg,
            covers=lay.covers,
            lanes=lay.lanes,
            search=search,
            stop=stop,
            watch=watch,
        )
        if planned.line == CELLS and each.overlap is not None:
            raise BadConfiguration(
                f"pass {index + 1} is a walk from cell to cell, which has no overlap",
                hint="leave its overlap out, or plan a line over the floor of a map with its scale",
            )
        plans.append(planned)
        line = planned.line
    return PassPlans(asked, tuple(plans))


def _robot_in(each: Pass, robot: RobotConfig) -> RobotConfig:
    """Return the robot with the speed and the overlap of a pass.

    Raises:
        BadConfiguration: the speed exceeds the robot's.
    """
    if each.speed_m_s is not None and each.speed_m_s > robot.speed_m_s:
        raise BadConfiguration(
            f"a pass at {each.speed_m_s:g} m/s is faster than the robot, {robot.speed_m_s:g} m/s"
        )
    if each.speed_m_s is not None:
        robot = msgspec.structs.replace(robot, speed_m_s=each.speed_m_s)
    return robot if each.overlap is None else robot.with_overlap(each.overlap)


def _end(end: str | Cell, plans: Sequence[Plan]) -> str | Cell:
    """Return the end of the last pass, where home is the start of the first pass."""
    if end != HOME or not plans:
        return end
    first = plans[0]
    if first.line == CELLS:
        return first.problem.start
    x, y = first.xy[0] // first.robot.tool_width_m
    return int(y), int(x)
