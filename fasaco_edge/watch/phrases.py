"""The wording of states, shares and times in a terminal."""

from __future__ import annotations

import time

from fasaco_edge.text import one_line

# Of the wall clock to the monotonic one, when this module was imported [s].
_OFFSET_S = time.time() - time.monotonic()


def covered(fraction: float, covered: int, coverable: int, covered_m2: float) -> str:
    """Return how much is covered."""
    return f"{percent(fraction)}: {covered} of {coverable} cells, {covered_m2:.1f} m2"


def percent(fraction: float) -> str:
    """Return a share; never 100.0 % before all is done."""
    shown = min(100 * fraction, 99.9) if fraction < 1.0 else 100.0
    return f"{shown:.1f} %"


def stage(stage: str | None, zone: str | None, number: int | None, passes: int | None) -> str:
    """Return the stage of a mission."""
    if stage is None:
        return "no order"
    if stage != "covering":
        return one_line(stage)
    what = f"zone {one_line(zone)}" if zone else "everything reachable"
    return f"{what}, pass {number} of {passes}"


def zone_progress(number: int, passes: int, covered: int, cells: int) -> tuple[str, str]:
    """Return which pass a zone is in, and how far that is."""
    at = f"{number} of {passes}" if number else "to come"
    return at, f"{percent(covered / cells if cells else 0.0)}: {covered} of {cells} cells"


def figures(
    state: str, covered: int, coverable: int, revision: int, steps: int, plans: int, plan_ms: float
) -> str:
    """Return state and progress in a line."""
    return (
        f"{one_line(state)}: {covered}/{coverable} cells, path {revision} ({steps} steps to go), "
        f"{plans} plans, last {plan_ms:.0f} ms"
    )


def steady_now() -> float:
    """Return the time since the epoch [s]; it does not step while this process runs."""
    return _OFFSET_S + time.monotonic()


def clock(at_s: float) -> str:
    """Return a steady time as a text, by the wall clock as it is set now."""
    wall_s = time.time() - (steady_now() - at_s)
    return time.strftime("%H:%M:%S", time.localtime(round(wall_s, 3)))


def age(seconds: float) -> str:
    """Return a time that has gone by."""
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes, hours = seconds / 60, seconds / 3600
    return f"{minutes:.0f} min" if hours < 2 else f"{hours:.1f} h"
