"""Accounts of the floor that a mission ever knew to be reachable, by a judge of its maps.

The judge (``judge.floor``) shares nothing with the mission's own count. Two things are to hold:
what the mission claims to have swept of the reachable floor, its record has of it; and all
floor that was ever reachable, and is free by the newest map, is told: as reachable now, or as out
of reach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import FREE
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from tests.campaigns.lab.mission import LabRun
from tests.campaigns.lab.truth import claimed_on, values_on


@dataclass(frozen=True, slots=True)
class FloorAccount:
    """Areas of floor at the end of a mission [m2].

    Attributes:
        ever: what was reachable on any map, and is free on the newest.
        closed: the part of it that is not reachable on the newest map and was not swept.
        swept: what is reachable on the newest map and was swept by the record.
        claimed: the same as the mission reports.
        told_closed: floor out of reach as the mission reports.
    """

    ever: float
    closed: float
    swept: float
    claimed: float
    told_closed: float

    @property
    def overclaimed(self) -> float:
        """By how much the claim is more than the record has, as a share.

        It may be less: by swept floor beside what stopped the robot and is on no map.
        """
        return max(self.claimed - self.swept, 0.0) / self.ever

    @property
    def untold(self) -> float:
        """Floor that is neither swept, nor left, nor out of reach as reported, as a share."""
        return max(self.closed - self.told_closed, 0.0) / self.ever


def account(run: LabRun) -> FloorAccount:
    """Return the account of a mission that counts floor, on maps of one raster without yaw."""
    of, settings = run.trace.columns(), run.settings
    robot = SweepingRobot(settings.tool_m, settings.robot.radius_m)
    judged = [
        judge_floor(grid, np.array([[of["px"][tick], of["py"][tick]]]), robot)
        for tick, grid in run.trace.maps
    ]
    _, newest = run.trace.maps[-1]
    raster = judged[0].geometry
    windows = [_window(raster, one.geometry) for one in judged]
    whole = Window.around(*windows)
    assert whole is not None
    shape = whole.rows, whole.cols
    ever, now = np.zeros(shape, bool), np.zeros(shape, bool)
    for one, window in zip(judged, windows, strict=True):
        ever[window.slices_in(whole)] |= one.reachable
    now[windows[-1].slices_in(whole)] = judged[-1].reachable
    origin = Pose2D(*raster.to_map(whole.col0, whole.row0), raster.origin.yaw)
    geometry = GridGeometry(*shape, raster.resolution, origin)
    swept = claimed_on(geometry, run.report.floor)
    ever &= values_on(geometry, newest) == FREE
    floor = run.report.reply["floor"]
    left, beyond = (sum(p["m2"] for p in floor[name] or ()) for name in ("left", "out_of_reach"))
    pixel_m2 = geometry.resolution**2
    m2 = [float(np.count_nonzero(mask)) * pixel_m2 for mask in (ever, ever & ~now & ~swept)]
    return FloorAccount(
        *m2,
        swept=float(np.count_nonzero(now & swept)) * pixel_m2,
        claimed=(floor["reachable_m2"] or 0.0) - left,
        told_closed=beyond,
    )


def _window(raster: GridGeometry, other: GridGeometry) -> Window:
    """Return where another grid of the same raster lies on it."""
    col, row = map(round, raster.to_pixels(other.origin.x, other.origin.y))
    return Window(row, col, row + other.rows, col + other.cols)
