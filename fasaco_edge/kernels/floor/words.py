"""Words: the shortest curves of bounded curvature from pose to pose.

A word is a sequence of up to five pieces, arcs and straights. Forward only: L. E. Dubins, On Curves
of Minimal Length with a Constraint on Average Curvature, American Journal of Mathematics 79 (1957).
With reversing: J. A. Reeds and L. A. Shepp, Optimal Paths for a Car that Goes Both Forwards and
Backwards, Pacific Journal of Mathematics 145 (1990), whose sections are named at the formulas.

Lengths are in turning radii, so the length of an arc is its angle. A piece of negative length is
driven backward. A formula leads from the pose (0, 0, 0) to x, y [radii], yaw [rad]; it returns NaN
where it has no word.
"""

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_inner_kernel

# Limits on the pieces of a word, and on the words to a goal.
PIECES, MOST_WORDS = 5, 44
# Images of a formula: its own word, the mirror image, and with reversing both driven the other way.
MIRRORED, ALL_IMAGES = 2, 4
# Rounding must not turn a piece of no length into a full circle, nor lose it.
TINY = 1e-9
QUARTER = 0.5 * math.pi
# Sides of the pieces by formula: 1 left, 0 straight, -1 right. The first three formulas also have
# words that are driven forward only.
FORWARD = 3
SIDES = np.array(
    [
        (1, 0, 1, 0, 0),
        (1, 0, -1, 0, 0),
        (1, -1, 1, 0, 0),
        (1, -1, 1, 0, 0),
        (1, -1, 1, -1, 0),
        (1, -1, 1, -1, 0),
        (1, -1, 0, 1, 0),
        (1, -1, 0, -1, 0),
        (1, -1, 0, 1, 0),
        (1, -1, 0, -1, 0),
        (1, -1, 0, 1, -1),
    ],
    np.int8,
)
# Formulas whose words are driven in the opposite order.
IN_OPPOSITE_ORDER = np.array(
    [False, False, False, True, False, False, False, False, True, True, False]
)

Pieces = tuple[float, float, float, float, float]


@inlined
def _ahead(angle: float) -> float:
    """Return an angle in [0, 2 pi)."""
    return max((angle + TINY) % (2.0 * math.pi) - TINY, 0.0)


@inlined
def _least(angle: float) -> float:
    """Return an angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@inlined
def _is(length: float, sign: float) -> bool:
    return length * sign >= -TINY


@inlined
def _near(x: float, y: float, yaw: float) -> tuple[float, float]:
    """Return the goal's left circle, from the start's."""
    return x - math.sin(yaw), y - 1.0 + math.cos(yaw)


@inlined
def _far(x: float, y: float, yaw: float) -> tuple[float, float]:
    """Return the goal's right circle, from the start's left one."""
    return x + math.sin(yaw), y - 1.0 - math.cos(yaw)


@inlined
def _none() -> Pieces:
    return math.nan, 0.0, 0.0, 0.0, 0.0


@inlined
def _same(x: float, y: float, yaw: float, ahead: bool) -> Pieces:
    """L+ S+ L+ (8.1)."""
    xi, eta = _near(x, y, yaw)
    theta = math.atan2(eta, xi)
    t = _ahead(theta) if ahead else _least(theta)
    v = _ahead(yaw - t) if ahead else _least(yaw - t)
    if _is(t, 1.0) and _is(v, 1.0):
        return t, math.sqrt(xi * xi + eta * eta), v, 0.0, 0.0
    return _none()


@inlined
def _across(x: float, y: float, yaw: float, ahead: bool) -> Pieces:
    """L+ S+ R+ (8.2)."""
    xi, eta = _far(x, y, yaw)
    square = xi * xi + eta * eta - 4.0
    if square >= -TINY:
        u = math.sqrt(max(square, 0.0))
        t = math.atan2(eta, xi) + math.atan2(2.0, u)
        t = _ahead(t) if ahead else _least(t)
        v = _ahead(t - yaw) if ahead else _least(t - yaw)
        if _is(t, 1.0) and _is(v, 1.0):
            return t, u, v, 0.0, 0.0
    return _none()


@inlined
def _three(x: float, y: float, yaw: float, ahead: bool) -> Pieces:
    """L+ R- L, either way (8.3, 8.4); forward only the middle arc goes the long way round."""
    xi, eta = _near(x, y, yaw)
    rho = math.sqrt(xi * xi + eta * eta)
    if rho <= 4.0 + TINY:
        u = -2.0 * math.asin(min(0.25 * rho, 1.0))
        t = math.atan2(eta, xi) + 0.5 * u + math.pi
        if ahead:
            t = _ahead(t)
            return t, 2.0 * math.pi + u, _ahead(yaw - t + u), 0.0, 0.0
        t = _least(t)
        if _is(t, 1.0):
            return t, u, _least(yaw - t + u), 0.0, 0.0
    return _none()


@inlined
def _outer(u: float, v: float, xi: float, eta: float, yaw: float) -> tuple[float, float]:
    """Return the first and the last arc of a word of four arcs (8.5, 8.6)."""
    delta = _least(u - v)
    a = math.sin(u) - math.sin(delta)
    b = math.cos(u) - math.cos(delta) - 1.0
    t = math.atan2(eta * a - xi * b, xi * a + eta * b)
    if 2.0 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3.0 < 0.0:
        t += math.pi
    tau = _least(t)
    return tau, _least(tau - u + v - yaw)


@inlined
def _four(x: float, y: float, yaw: float, alike: bool) -> Pieces:
    """L+ R+ L- R- (8.7), or L+ R- L- R+ (8.8), with two equal arcs in the middle."""
    xi, eta = _far(x, y, yaw)
    square = xi * xi + eta * eta
    rho = 0.25 * (2.0 + math.sqrt(square)) if alike else (20.0 - square) / 16.0
    if -TINY <= rho <= 1.0 + TINY:
        arc = math.acos(min(max(rho, 0.0), 1.0))
        u = arc if alike else -arc
        w = -u if alike else u
        t, v = _outer(u, w, xi, eta, yaw)
        if _is(t, 1.0) and _is(v, -1.0 if alike else 1.0):
            return t, u, w, v, 0.0
    return _none()


@inlined
def _quarter(x: float, y: float, yaw: float, same: bool) -> Pieces:
    """L+ R- S- L- (8.9), or L+ R- S- R- (8.10), with a quarter-turn in the second place."""
    t = u = v = 0.0
    xi, eta = _near(x, y, yaw) if same else _far(x, y, yaw)
    rho = math.sqrt(xi * xi + eta * eta)
    if rho < 2.0 - TINY:
        return _none()
    if same:
        r = math.sqrt(max(rho * rho - 4.0, 0.0))
        u = 2.0 - r
        t = _least(math.atan2(eta, xi) + math.atan2(r, -2.0))
        v = _least(yaw - QUARTER - t)
    else:
        u = 2.0 - rho
        t = math.atan2(xi, -eta)
        v = _least(t + QUARTER - yaw)
    if _is(t, 1.0) and _is(u, -1.0) and _is(v, -1.0):
        return t, -QUARTER, u, v, 0.0
    return _none()


@inlined
def _quarters(x: float, y: float, yaw: float) -> Pieces:
    """L+ R- S- L- R+ with two quarter-turns (8.11)."""
    xi, eta = _far(x, y, yaw)
    square = xi * xi + eta * eta - 4.0
    if square >= -TINY:
        u = 4.0 - math.sqrt(max(square, 0.0))
        t = _least(math.atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta))
        v = _least(t - yaw)
        if _is(u, -1.0) and _is(t, 1.0) and _is(v, 1.0):
            return t, -QUARTER, u, -QUARTER, v
    return _none()


@inlined
def _pieces(formula: int, x: float, y: float, yaw: float, ahead: bool) -> Pieces:
    found = _none()
    if formula == 0:
        found = _same(x, y, yaw, ahead)
    elif formula == 1:
        found = _across(x, y, yaw, ahead)
    elif formula <= 3:
        found = _three(x, y, yaw, ahead)
    elif formula <= 5:
        found = _four(x, y, yaw, formula == 4)
    elif formula <= 9:
        found = _quarter(x, y, yaw, (formula & 1) == 0)
    else:
        found = _quarters(x, y, yaw)
    return found


@inlined
def _turn_round(sides: NDArray[np.int8], lengths: NDArray[np.float64]) -> None:
    """Reverse the order of the pieces."""
    for piece in range(PIECES // 2):
        other = PIECES - 1 - piece
        sides[piece], sides[other] = sides[other], sides[piece]
        lengths[piece], lengths[other] = lengths[other], lengths[piece]


@lean_inner_kernel
def find_words(
    x: float,
    y: float,
    yaw: float,
    reverses: bool,
    sides: NDArray[np.int8],
    lengths: NDArray[np.float64],
) -> int:
    """Find the words to a goal; return their number.

    Args:
        x, y, yaw: the goal [radii, rad].
        reverses: whether pieces may be driven backward.
        sides: int8 (``MOST_WORDS``, 5), to fill: 1 left, 0 straight, -1 right.
        lengths: float64 (``MOST_WORDS``, 5), to fill [radii].
    """
    cos, sin = math.cos(yaw), math.sin(yaw)
    back_x, back_y = x * cos + y * sin, x * sin - y * cos
    count = 0
    for image in range(ALL_IMAGES if reverses else MIRRORED):
        mirror, flip = 1.0 - 2.0 * (image & 1), 1.0 - 2.0 * (image >> 1)
        for formula in range(len(SIDES) if reverses else FORWARD):
            is_opposite = IN_OPPOSITE_ORDER[formula]
            px, py = (back_x, back_y) if is_opposite else (x, y)
            a, b, c, d, e = _pieces(
                formula, flip * px, mirror * py, flip * mirror * yaw, not reverses
            )
            if math.isnan(a):
                continue
            lengths[count, 0], lengths[count, 1], lengths[count, 2] = flip * a, flip * b, flip * c
            lengths[count, 3], lengths[count, 4] = flip * d, flip * e
            for piece in range(PIECES):
                sides[count, piece] = int(mirror) * SIDES[formula, piece]
            if is_opposite:
                _turn_round(sides[count], lengths[count])
            count += 1
    return count
