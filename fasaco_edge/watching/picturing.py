"""The picture of what is known; ground and coverage are drawn anew only where they changed."""

from __future__ import annotations

from fasaco_edge.watching import picture
from fasaco_edge.watching.frame import Bounds, Frame, joint_bounds, known_bounds
from fasaco_edge.watching.known import Known


class Picturing:
    """Keeps the ground of the last picture.

    Attributes:
        pixel_m: edge of a pixel of that picture [m]; None before the first.
        path_is_whole: whether all of the path was drawn.
    """

    def __init__(self) -> None:
        self.pixel_m: float | None = None
        self.path_is_whole = True
        self._key: tuple[object, ...] = ()
        self._bounds: Bounds | None = None
        self._frame: Frame | None = None
        self._ground: picture.Kinds | None = None

    def kinds(self, known: Known, columns: int, lines: int) -> picture.Kinds | None:
        """Return a picture, uint8 (2 * lines, columns); None as long as nothing is to be seen."""
        # Grids are values: a new one is another object.
        if (key := (known.map, known.coverage)) != self._key:
            self._key, self._frame = key, None
            grids = [grid for grid in key if grid is not None]
            self._bounds = joint_bounds([b for grid in grids if (b := known_bounds(grid))])
        bounds = self._with_robot(known)
        if bounds is None:
            return None
        frame = Frame.over(bounds, columns, lines)
        if frame != self._frame or self._ground is None:
            self._frame, self._ground = frame, picture.ground(frame, known.map, known.coverage)
        kinds = self._ground.copy()
        self.pixel_m = frame.pixel_m
        self.path_is_whole = picture.draw_path(kinds, frame, known.path_ahead)
        if known.pose is not None:
            radius_m = known.report.config.robot.radius_m if known.report else 0.0
            picture.draw_robot(kinds, frame, known.pose, radius_m)
        return kinds

    def _with_robot(self, known: Known) -> Bounds | None:
        pose, parts = known.pose, [self._bounds] if self._bounds else []
        # A robot alone is no picture.
        if pose is not None and parts:
            parts.append((pose.x, pose.y, pose.x, pose.y))
        return joint_bounds(parts)
