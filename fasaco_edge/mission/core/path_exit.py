"""Path exit: the owner of the published path, and the only place where paths are published.

It outlives the missions of a daemon. When the mission of a path comes to rest or ends, the exit
replaces the path by an empty one, which stops the robot. This gives two invariants, also if a
mission is replaced or fails:

- the last path of a mission at rest is empty;
- a path that is not empty belongs to the mission in force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Bounds

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.events import PathUpdate
    from fasaco_edge.planners.path import CoveragePath


def no_points() -> NDArray[np.float64]:
    """Return the points of an empty path, float64 (0, 2)."""
    return np.empty((0, 2))


@dataclass(frozen=True, slots=True, eq=False)
class PublishedPath:
    """A path as published, in the map frame.

    Attributes:
        frame: the map frame.
        reason: why it replaces the previous path.
        revision: counts the paths of a mission, from 1, including the empty path at its end; 0 if
            there was no mission.
        xy: float64 (n, 2), x, y [m]; n = 0 stops the robot.
        steps: steps from cell to cell.
        end_yaw: heading at the end [rad]; None for the heading of the last segment.
        yaw: float64 (n,), the robot's headings [rad]; None for headings along the path.
        map_stamp_ns, map_revision: stamp [ns] and revision of the map it was planned on.
        plan: the plan that it comes from; None if none was needed.
        plan_s: planning time [s].
        changed: bounds of the cells that changed [m], if they are the reason; else None.
    """

    frame: str
    reason: str
    revision: int = 0
    xy: NDArray[np.float64] = field(default_factory=no_points)
    steps: int = 0
    end_yaw: float | None = None
    yaw: NDArray[np.float64] | None = None
    map_stamp_ns: int = 0
    map_revision: int = 0
    plan: CoveragePath | None = None
    plan_s: float = 0.0
    changed: Bounds | None = None
    speed_m_s: float | None = None

    @classmethod
    def of(cls, mission: Mission, update: PathUpdate) -> PublishedPath:
        """Return the path that a mission decided on in its last step."""
        grid, lattice = mission.grid, mission.lattice
        assert grid is not None
        assert lattice is not None
        changed = None
        if update.changed is not None:
            changed = mission.rotation.cells(update.changed, lattice.cell_m).bounds()
        return cls(
            frame=grid.frame,
            reason=update.reason,
            revision=update.revision,
            xy=lattice.centres(update.cells) if update.xy is None else update.xy,
            steps=max(len(update.cells) - 1, 0),
            end_yaw=update.end_yaw,
            yaw=update.yaw,
            map_stamp_ns=grid.stamp_ns,
            map_revision=mission.map.map_revision,
            plan=update.plan,
            plan_s=update.plan_s,
            changed=changed,
            speed_m_s=update.speed_m_s,
        )

    @property
    def stops(self) -> bool:
        """Whether the path is empty, and stops the robot."""
        return not len(self.xy)

    def withdrawn(self, reason: str) -> PublishedPath:
        """Return the empty path that replaces this one."""
        return PublishedPath(
            self.frame,
            reason,
            self.revision + 1,
            map_stamp_ns=self.map_stamp_ns,
            map_revision=self.map_revision,
        )


class PathExit:
    """Decides which path is published next, and keeps it until it is sent."""

    def __init__(self) -> None:
        # The path that was sent last, None if unknown; the path to send next, None for none.
        self._sent: PublishedPath | None = None
        self._due: PublishedPath | None = None

    @property
    def newest(self) -> PublishedPath | None:
        """The path to send, or else the last path sent; None before the first."""
        return self._due or self._sent

    def follow(self, mission: Mission, update: PathUpdate | None) -> None:
        """Take the path of a mission's step, if any; withdraw it if the mission is at rest."""
        if update is not None:
            self._due = PublishedPath.of(mission, update)
        if mission.state.is_at_rest:
            self.withdraw(mission.reason)

    def withdraw(self, reason: str) -> None:
        """Replace the newest path by an empty one, unless it is empty."""
        newest = self.newest
        if newest is not None and not newest.stops:
            self._due = newest.withdrawn(reason)

    def void(self, reason: str, frame: str) -> None:
        """Replace any path by an empty one, even a path of another daemon or an earlier process."""
        self.withdraw(reason)
        self._due = self._due or PublishedPath(frame, reason)

    def forget(self) -> None:
        """Send nothing more: another daemon publishes from now on."""
        self._sent = self._due = None

    def send(self, publish: Callable[[PublishedPath], bool]) -> PublishedPath | None:
        """Send the path that is due, and return it; None if none is due, or if it cannot be sent.

        If a path cannot be sent, an empty path is sent instead: the robot must not follow the
        previous path. Each call tries again until a path is sent.

        Args:
            publish: sends a path; returns whether that succeeded.
        """
        if self._due is None:
            return None
        if not publish(self._due):
            if self._due.stops:
                return None
            self._due = replace(self._due, xy=no_points(), steps=0, end_yaw=None, yaw=None)
            if not publish(self._due):
                return None
        self._sent, self._due = self._due, None
        return self._sent
