"""Conventions of map files that contradict each other: values of keys, and content of an image.

ROS 2's map_saver writes three greys in trinary mode: black, 254, and 205 for never seen. Until
2025 it wrote ``free_thresh: 0.25`` beside them, by which map_server takes 205, 19.6 % occupied, for
free; since then it writes 0.196, as in ROS 1 (navigation2 PR 5278). Here that grey is unknown if
map_saver wrote it: a robot must not drive over ground that was never seen.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.map_images import MapImage
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN

# map_saver's greys for free and never seen, of 255.
SEEN_FREE, NEVER_SEEN = 254, 205

RAW = (
    "{} pixels of greys from 101 to 254 are unknown in mode raw, and black ones free: if black is "
    "wall, write mode: trinary"
)
NEGATED = (
    "negate: 1 makes walls of white, and of {} pixels of the grey 205 that map_saver writes for "
    "never seen: if white is floor, write negate: 0"
)
UNSEEN = (
    "{} pixels of the grey 205, which map_saver writes for never seen, are {} by its keys: they "
    "are taken for unknown; write mode: trinary and free_thresh: 0.196, or give floor another grey"
)


def settle(
    image: MapImage, values: NDArray[np.int8], mode: str, *, negate: bool, is_mask: bool
) -> str:
    """Return a contradiction of keys and image, with its remedy; "" for none.

    Args:
        image, mode, negate: of the map file.
        values: int8 (white + 1,), the cell value of each level. Changed in place: map_saver's grey
            for never seen becomes unknown.
        is_mask: whether unknown is the same as free.
    """
    never_seen = NEVER_SEEN * image.white // 255
    given = values[never_seen]
    if mode == "raw":
        # Raw images hold 0 .. 100, and 255 for unknown.
        lost = _counts(image)[OCCUPIED + 1 : 255].sum()
        return RAW.format(lost) if lost else ""
    if given == UNKNOWN:
        return ""
    counts = _counts(image)
    unseen = counts[NEVER_SEEN]
    if negate:
        is_savers = unseen and counts[SEEN_FREE] and given == OCCUPIED
        return NEGATED.format(unseen) if is_savers else ""
    # The grey is from map_saver, and not one of many shades, if most grey pixels have it.
    is_grey = (values[:: image.white // 255] != OCCUPIED) & (np.arange(256) < SEEN_FREE)
    if is_mask or 2 * unseen <= counts[is_grey].sum():
        return ""
    values[never_seen] = UNKNOWN
    return UNSEEN.format(unseen, "free" if given == FREE else f"{given} % occupied")


def _counts(image: MapImage) -> NDArray[np.int64]:
    """Return how many pixels have each level, int64 (256,), rounded down to one of 0 .. 255."""
    counts = np.zeros(256, np.int64)
    for stripe in image.stripes():
        levels = stripe.levels // np.uint16(image.white // 255)
        counts += np.bincount(levels.ravel(), minlength=256)
    return counts


def yaw_in_degrees(yaw: float) -> str:
    """Return the fault of an origin's yaw of more than a full turn; "" for none."""
    if abs(yaw) <= 2.0 * math.pi:
        return ""
    return f"origin's yaw is in radians, got {yaw:g}: if these are degrees, {math.radians(yaw):.4f}"
