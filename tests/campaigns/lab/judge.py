"""A judge of missions in the lab: what the product claims, against the true poses."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.campaigns.lab.mission import DONE, LabRun
from tests.campaigns.lab.path_changes import changes_ahead
from tests.campaigns.lab.settings import TICK_S
from tests.campaigns.lab.truth import Truth, turns_between

# A mission that is done with less of the clear floor swept was not. Of all that can be reached a
# whole mission sweeps 85 to 89 %: the rim is too near to walls for a map of 5 cm.
LEAST_SHARE = 0.9
# A robot that stands for longer than this at the end will do so for good [s].
DEADLOCK_S = 60.0
# Contacts closer together are one [s].
APART_S = 1.0
# Slowest wheel speed and turn rate that count as motion [m/s, rad/s].
STANDS_M_S, TURNS_RAD_S = 0.01, 0.05
# Smallest true motion within a second that counts [m, rad].
STILL_M, STILL_RAD = 0.01, math.radians(2.0)
SECOND = round(1.0 / TICK_S)


class Ending(StrEnum):
    """How a mission ended."""

    DONE = "done"
    FALSE_DONE = "false done"
    DEADLOCK = "deadlock"
    LIMIT = "at the limit"


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of a mission.

    Attributes:
        ending: how it ended.
        true_share: swept share of the reachable floor, by the true poses.
        clear_share: the same of the floor that is a pixel of the map further from walls.
        claimed_share: as ``true_share``, by the product's status, of all floor that it takes for
            reachable: the possible floor at the end of the order, else that of the map.
        map_claimed_share: the same of the floor that its map shows in reach alone.
        excess_points: by how much the claim exceeds the truth [percentage points].
        claimed_unswept_m2: floor that the product takes for swept and that was not.
        swept_unclaimed_m2: floor that was swept and that it does not take for swept.
        reachable_m2: the truly reachable floor.
        people_touched, driven_into: separate contacts with people, and how many of these began
            while the robot drove towards them: into one that stands, or from behind, people walk
            by themselves.
        contacts, contact_s: separate contacts of the hull, and how long they lasted in all [s].
        pose_error_median_m, pose_error_p95_m, pose_error_most_m: of the pose that the product has.
        seconds: simulated time to the last motion [s].
        driven_m: way that was driven.
        speed_share: mean speed from the first to the last motion, of the highest.
        turning_share: share of that time in which it turned on the spot.
        stops_per_m: stops a metre.
        paths_per_min, changes_per_min: paths a minute: all, and those that change the next 2 m.
        longest_stand_s: how long it stood at most with work left.
        state, reason: the mission's at the end.
        coverage: covered share of the cells, as the product says.
        loops, plans: loops closed by the mapper, and plans made.
        digest: equal only for missions that are equal bit for bit.
    """

    ending: Ending
    true_share: float
    clear_share: float
    claimed_share: float
    map_claimed_share: float
    excess_points: float
    claimed_unswept_m2: float
    swept_unclaimed_m2: float
    reachable_m2: float
    people_touched: int
    driven_into: int
    contacts: int
    contact_s: float
    pose_error_median_m: float
    pose_error_p95_m: float
    pose_error_most_m: float
    seconds: float
    driven_m: float
    speed_share: float
    turning_share: float
    stops_per_m: float
    paths_per_min: float
    changes_per_min: float
    longest_stand_s: float
    state: str
    reason: str
    coverage: float
    loops: int
    plans: int
    digest: str

    @property
    def is_fault(self) -> bool:
        """Whether the mission ended as none may."""
        return self.ending in (Ending.FALSE_DONE, Ending.DEADLOCK)

    def document(self) -> dict[str, Any]:
        """Return these as JSON has them."""
        return {
            name: round(value, 4) if isinstance(value, float) else value
            for name, value in asdict(self).items()
        }


def truth_of(run: LabRun) -> Truth:
    """Return the truth of a mission."""
    of, settings = run.trace.columns(), run.settings
    xy = np.stack([of["x"], of["y"]], axis=1)
    return Truth.of(run.building, settings.radius_m, settings.tool_m, xy, run.report.floor)


def judge(run: LabRun, truth: Truth) -> Figures:
    """Return the figures of a mission."""
    trace, settings, reply = run.trace, run.settings, run.report.reply
    of = trace.columns()
    still = _still_seconds(of)
    stands_s = _runs(still & ~_each_second(of["done"]))
    moves = np.flatnonzero(_moves(of))
    first, last = (int(moves[0]), int(moves[-1])) if len(moves) else (0, 0)
    live = slice(first, last + 1)
    live_s = max((last - first) * TICK_S, TICK_S)
    ways = np.hypot(np.diff(of["x"]), np.diff(of["y"]))
    driven_m = float(ways.sum())
    drives = np.abs(of["speed"]) >= STANDS_M_S
    turns = ~drives & (np.abs(of["turn_rate"]) > TURNS_RAD_S)
    stops = int(np.count_nonzero(drives[:-1] & ~drives[1:]))
    errors = np.hypot(of["px"] - of["x"], of["py"] - of["y"])
    changes = sum(changes_ahead(trace.paths, of["px"], of["py"]))
    contacts, contact_s = _contacts(of["touches"] > 0.0)
    touched = _begins(of["touches_person"] > 0.0)
    claimed, map_claimed, coverage = _claim(reply)
    true, clear = truth.share(truth.reachable), truth.share(truth.clear)
    at_end_s = stands_s[-1] if len(stands_s) and still[-1] and not of["done"][-1] else 0
    return Figures(
        ending=_ending(reply["state"], clear, at_end_s),
        true_share=true,
        clear_share=clear,
        claimed_share=claimed,
        map_claimed_share=map_claimed,
        excess_points=100.0 * (claimed - true),
        claimed_unswept_m2=truth.m2(truth.claimed & ~truth.swept & truth.free),
        swept_unclaimed_m2=truth.m2(truth.swept & ~truth.claimed & truth.free),
        reachable_m2=truth.m2(truth.reachable),
        people_touched=len(touched),
        driven_into=int(
            np.count_nonzero(
                (of["speed"][touched] >= STANDS_M_S) & (of["touches_person"][touched] > 1.0)
            )
        ),
        contacts=contacts,
        contact_s=contact_s,
        pose_error_median_m=float(np.median(errors)),
        pose_error_p95_m=float(np.percentile(errors, 95)),
        pose_error_most_m=float(errors.max()),
        seconds=float(of["t"][last]),
        driven_m=driven_m,
        speed_share=driven_m / live_s / settings.speed_m_s,
        turning_share=float(np.mean(turns[live])),
        stops_per_m=stops / max(driven_m, 1.0),
        paths_per_min=60.0 * len(trace.paths) / live_s,
        changes_per_min=60.0 * changes / live_s,
        longest_stand_s=float(max(stands_s, default=0)),
        state=reply["state"],
        reason=reply["reason"],
        coverage=coverage,
        loops=trace.loops,
        plans=run.report.plans,
        digest=trace.digest(),
    )


def _ending(state: str, share: float, at_end_s: float) -> Ending:
    if state == DONE:
        return Ending.DONE if share >= LEAST_SHARE else Ending.FALSE_DONE
    return Ending.DEADLOCK if at_end_s > DEADLOCK_S else Ending.LIMIT


def _claim(reply: dict[str, Any]) -> tuple[float, float, float]:
    """Return the claimed shares of possible floor, of the map's floor, and of cells."""
    floor, coverage = reply["floor"] or {}, reply["coverage"] or {}
    cells = float(coverage.get("fraction") or 0.0)
    reachable_m2, left = floor.get("reachable_m2"), floor.get("left")
    if not reachable_m2 or left is None:
        return cells, cells, cells
    reached_m2 = max(reachable_m2 - sum(part["m2"] for part in left), 0.0)
    possible_m2 = max(floor.get("possible_m2") or 0.0, reachable_m2)
    return reached_m2 / possible_m2, reached_m2 / reachable_m2, cells


def _moves(of: dict[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Return in which ticks the wheels turn, bool (ticks,)."""
    return (np.abs(of["speed"]) >= STANDS_M_S) | (np.abs(of["turn_rate"]) > TURNS_RAD_S)


def _still_seconds(of: dict[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Return in which whole seconds the robot truly stood, bool (seconds,); wheels may spin."""
    x, y, yaw = (of[name][::SECOND] for name in ("x", "y", "yaw"))
    far = np.hypot(np.diff(x), np.diff(y))
    still: NDArray[np.bool_] = (far < STILL_M) & (np.abs(turns_between(yaw)) < STILL_RAD)
    return still


def _each_second(flags: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a column at the end of each whole second."""
    return flags[::SECOND][1:] > 0.0


def _runs(flags: NDArray[np.bool_]) -> list[int]:
    """Return the lengths of the runs of True, in order."""
    edges = np.diff(np.concatenate([[False], flags, [False]]).astype(int))
    lengths: list[int] = (np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)).tolist()
    return lengths


def _contacts(touches: NDArray[np.bool_]) -> tuple[int, float]:
    """Return the number of separate contacts, and how long they lasted in all [s]."""
    return len(_begins(touches)), float(touches.sum()) * TICK_S


def _begins(touches: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the ticks in which separate contacts begin, int (n,)."""
    begins = np.flatnonzero(np.diff(np.concatenate([[False], touches]).astype(int)) > 0)
    apart = np.diff(begins) * TICK_S > APART_S
    return begins[np.concatenate([[True], apart])] if len(begins) else begins
