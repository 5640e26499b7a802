"""The outcome of a mission, a line of the run card: state, time, reason, swept floor."""

from __future__ import annotations

from fasaco_edge.client.phrases import scale_words
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.text import duration
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.reasons import plain

# States in which there is no outcome yet.
UNDER_WAY = ("planning", "covering")


class Outcome:
    """The outcome, by poses and statuses; "" while the mission is under way.

    Attributes:
        text: the line.
    """

    def __init__(self) -> None:
        self.text = ""
        self._began_ns = self._now_ns = 0
        self._state = ""

    def add_pose(self, stamped: StampedPose) -> None:
        """Note the robot's clock; a robot without one has stamps of 0."""
        self._began_ns, self._now_ns = self._began_ns or stamped.stamp_ns, stamped.stamp_ns

    def add_status(self, status: Status) -> None:
        """Note the mission's state, once when it is entered."""
        if status.state == self._state:
            return
        self._state, self.text = status.state, ""
        if status.state in UNDER_WAY:
            return
        words = f"**{status.state}**"
        if self._now_ns > self._began_ns:
            words += f" after {duration(1e-9 * (self._now_ns - self._began_ns))}"
        if simulated := scale_words(known_settings(status.config).robot.time_scale):
            words += f" ({simulated})"
        said = [plain(status.reason)] if status.reason else []
        floor = status.floor
        if floor is not None and floor.reachable_m2 and "swept" not in status.reason:
            said.append(f"{floor.swept_m2:.1f} of {floor.reachable_m2:.1f} m2 swept")
        self.text = ": ".join([words, *filter(None, ["; ".join(said)])])
