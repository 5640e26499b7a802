"""Driving time of a polyline: straight from point to point, turns on the spot."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.turning import Turning, turn_seconds
from fasaco_edge.kernels.jit import inlined, lean_kernel

_turn_s = inlined(turn_seconds)


@inlined
def _arctangent(ratio: float) -> float:
    """Return the arctangent of a ratio in [0, 1], to 1e-5 rad, the same on every machine.

    M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions, 4.4.49.
    """
    square = ratio * ratio
    series = 0.0208351 * square - 0.085133
    series = series * square + 0.180141
    series = series * square - 0.3302995
    return ratio * (series * square + 0.999866)


@inlined
def turn_between(uy: float, ux: float, vy: float, vx: float) -> float:
    """Return the angle from one direction to another [rad], in [0, pi]."""
    sine, cosine = abs(ux * vy - uy * vx), ux * vx + uy * vy
    if sine <= 1e-9 * abs(cosine):
        return 0.0 if cosine >= 0.0 else np.pi
    if cosine >= 0.0:
        angle = (
            _arctangent(sine / cosine)
            if sine <= cosine
            else 0.5 * np.pi - _arctangent(cosine / sine)
        )
    elif sine <= -cosine:
        angle = np.pi - _arctangent(sine / -cosine)
    else:
        angle = 0.5 * np.pi + _arctangent(-cosine / sine)
    return angle


@inlined
def edge_s(points: NDArray[np.float64], a: int, b: int, drive_s: float) -> float:
    """Return the seconds of the edge between two points."""
    dy, dx = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    return float(drive_s * np.sqrt(dy * dy + dx * dx))


@inlined
def turn_s(points: NDArray[np.float64], a: int, b: int, c: int, turning: Turning) -> float:
    """Return the seconds of the turn at the second of three points."""
    uy, ux = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    vy, vx = points[c, 0] - points[b, 0], points[c, 1] - points[b, 1]
    return _turn_s(turning, turn_between(uy, ux, vy, vx))


@lean_kernel
def chain_s(
    points: NDArray[np.float64],
    first: int,
    last: int,
    count: int,
    drive_s: float,
    turning: Turning,
) -> float:
    """Return the driving time of a chain [s]: edges from ``first`` to ``last``, and all turns.

    Args:
        points: float64 (count or more, 2): y, x [pixels].
        first, last: points.
        count: of points.
        drive_s: for a pixel driven [s].
        turning: durations of turns.
    """
    seconds = 0.0
    for number in range(first, last):
        seconds += edge_s(points, number, number + 1, drive_s)
    for number in range(1, count - 1):
        seconds += turn_s(points, number - 1, number, number + 1, turning)
    return seconds
