"""Parameters of a robot with a turning radius; imports no numba, to load configurations fast."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CurveConfig:
    """How a robot with a turning radius drives.

    Attributes:
        radius_m: radius of its tightest arcs, above 0 [m].
        reverses: whether it can drive backward.
        speed_m_s, arc_m_s: on straights and on arcs [m/s].
        stop_s: additional time of a change between forward and backward [s].
        price_s_m2: value of sweeping a square metre [s/m2].
    """

    radius_m: float
    reverses: bool
    speed_m_s: float
    arc_m_s: float
    stop_s: float
    price_s_m2: float
