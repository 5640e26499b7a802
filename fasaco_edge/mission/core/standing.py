"""Standing: how long the robot has been in its cell, and in one place with a path to drive; and the
obstructions that its follower reports.

Time in one place counts only with a path. It starts again if the robot moves, or rests by command
or at the end of an order; it continues with a new path. Times are [s].
"""

from __future__ import annotations

import math

from fasaco_edge.errors import WrongFrame
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.events import FollowerBlocked
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.stay import Stay
from fasaco_edge.mission.path.route import Route

# Minimum time between new plans for a robot that left its path or stands still at its end: poses
# that jump to and fro must not keep the planner busy.
PATIENCE_S = 1.0
# A robot that stands on its path, within STANDING_M [m] for STANDING_S [s], gets the path again:
# the follower may have lost it, or stopped for an obstacle that is gone. A shorter time would
# interrupt a robot that waits for a person to pass, or drives out of a corner. The time is by the
# robot's clock, as a simulation may run at twenty times the real speed.
STANDING_S, STANDING_M = 30.0, 0.1
# Number of times that a standing robot gets its path again before its mission is degraded.
TRIES = 2
# A robot counts as turning if its heading has changed this much lately [rad].
TURNS_RAD = 0.1
# A robot that stands beside its path gets a new path after this time: an obstacle may separate it
# from the path.
BESIDE_S = 2.0


class Standing:
    def __init__(self, map_state: MapState, route: Route) -> None:
        self._map, self._route = map_state, route
        self._now = 0.0
        self._cell: Cell | None = None
        self._entered_at = 0.0
        # The robot's place, and the start of its stay there, by our clock and by the robot's [ns].
        # A time without a path moves the start forward.
        self._stay, self._since_ns = Stay(STANDING_M), 0
        # The last time that the robot had a path to drive there, by both clocks.
        self._had_path = 0.0, 0
        # Number of times that the robot got its path again there.
        self._tries = 0
        # The robot's yaw when it last turned [rad], and the time of that turn.
        self._yaw, self._turned_at = 0.0, -math.inf

    def continue_from(self, before: Standing) -> None:
        """Take over a predecessor's count of the time and of the tries."""
        self._stay, self._since_ns, self._tries = before._stay, before._since_ns, before._tries
        self._had_path = before._had_path

    def reset(self) -> None:
        """Forget the place: the robot rests, and must not drive."""
        self._stay.forget()

    def update(self, cell: Cell, now: float) -> None:
        """Update the robot's cell and place; to be called in each step."""
        self._now = now
        self._update_place()
        self._update_yaw()
        if cell != self._cell:
            self._cell, self._entered_at = cell, now

    @property
    def in_cell_s(self) -> float:
        """How long the robot has been in its cell."""
        return self._now - self._entered_at

    @property
    def has_waited(self) -> bool:
        """Whether the robot has had its path for a moment."""
        return self._now - self._route.published_at >= PATIENCE_S

    @property
    def turns(self) -> bool:
        """Whether the robot has just turned, for instance on the spot to drive its path."""
        return self._now - self._turned_at < PATIENCE_S

    def is_at(self, last: Cell | None) -> bool:
        """Return whether the robot stands in the last cell of a path that it did not complete.

        The robot's index on the path is then below the last, as it has missed a cell.
        """
        if self._cell != last or last == tuple(self._route.path.ahead[0].tolist()):
            return False
        return self.has_waited and self.in_cell_s >= PATIENCE_S

    @property
    def is_beside_path(self) -> bool:
        """Whether the robot stands in a cell that is not its place on the path."""
        ahead = self._route.path.ahead
        is_beside = len(ahead) > 1 and self._cell != tuple(ahead[0].tolist())
        has_path_s = self._now - self._route.published_at
        return is_beside and has_path_s >= BESIDE_S and self._in_place_s() >= BESIDE_S

    @property
    def is_on_path(self) -> bool:
        """Whether the robot has stood in one place for long, with a path to drive."""
        return self._has_path and self._in_place_s() >= STANDING_S

    def record_try(self) -> None:
        """Record that the robot gets its path again."""
        assert self._map.pose is not None
        self._tries += 1
        self._stay.count_from(self._now)
        self._since_ns = self._map.pose.stamp_ns

    @property
    def why_stuck(self) -> str:
        """Why the robot seems unable to drive its path; "" if it drives."""
        stamped = self._map.pose
        if stamped is None or not self._has_path or self._tries < TRIES:
            return ""
        if self._stay.has_left((stamped.pose.x, stamped.pose.y)):
            return ""
        return f"the robot stands: it got a path {self._tries + 1} times"

    @property
    def _has_path(self) -> bool:
        return len(self._route.path.ahead) > 1

    def _update_place(self) -> None:
        """Update the robot's place, and whether it has a path to drive."""
        assert self._map.pose is not None
        stamped = self._map.pose
        here, at = (stamped.pose.x, stamped.pose.y), (self._now, stamped.stamp_ns)
        if self._stay.update(here, self._now):
            self._since_ns, self._had_path, self._tries = stamped.stamp_ns, at, 0
        elif not self._has_path:
            return
        elif (begun_at := self._route.begun_at) > self._had_path[0]:
            had_at, had_ns = self._had_path
            self._stay.count_from(self._stay.since + begun_at - had_at)
            self._since_ns += stamped.stamp_ns - had_ns
        self._had_path = at

    def _update_yaw(self) -> None:
        assert self._map.pose is not None
        yaw = self._map.pose.pose.yaw
        if abs(math.remainder(yaw - self._yaw, math.tau)) > TURNS_RAD:
            self._yaw, self._turned_at = yaw, self._now

    def _in_place_s(self) -> float:
        """Return how long the robot has stood in one place with a path to drive.

        The longer of the times by our clock and by the robot's counts, as stamps may stand still.
        """
        assert self._map.pose is not None
        theirs_s = (self._map.pose.stamp_ns - self._since_ns) * 1e-9
        return max(self._now - self._stay.since, theirs_s)


# A report is valid for this long, as the follower repeats it once a second.
VALID_S = 3.0
# Period of new paths for a follower that cannot join its path, or is blocked at an unknown place.
AGAIN_S = 5.0


class BlockedFollower:
    """Keeps the follower's newest report of what keeps the robot from driving."""

    def __init__(self) -> None:
        self._newest: FollowerBlocked | None = None
        self._at = self._asked_at = -math.inf

    def receive(
        self, event: FollowerBlocked, map_state: MapState, revision: int, now: float
    ) -> bool:
        """Take in a report, and close floor with a reported obstacle for a while; return whether
        that changes the map.

        Raises:
            WrongFrame: the report is in another frame than the map's.
        """
        grid = map_state.grid
        # A report on an earlier path is ignored; the follower repeats it if it still applies.
        if grid is None or event.revision not in (0, revision):
            return False
        if event.frame != grid.frame:
            raise WrongFrame(
                f"blocked in frame {event.frame!r}, map in {grid.frame!r}",
                hint="let the follower report in the frame of the path that it drives",
            )
        self._newest, self._at = event, now
        is_closed = map_state.obstacles.close(event.points, (event.x, event.y), now)
        if is_closed:
            map_state.draw_obstacles()
        return is_closed

    def why(self, now: float) -> str:
        """Return what keeps the robot from driving; "" for nothing."""
        report = self._report(now)
        return f"the robot stands: {report.detail}, for {report.held_s:.0f} s" if report else ""

    def asks_again(self, now: float) -> str:
        """Return why a new path from the robot's place is due, or ""."""
        report = self._report(now)
        if report is None or report.points or now - self._asked_at < AGAIN_S:
            return ""
        self._asked_at = now
        return f"the robot cannot follow it: {report.detail}"

    def _report(self, now: float) -> FollowerBlocked | None:
        return self._newest if now - self._at <= VALID_S else None
