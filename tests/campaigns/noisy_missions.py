"""Missions under the noise of the project's own mapper, and what has to hold at the end of each.

    python -m tests.campaigns.noisy_missions --seeds 5
    python -m tests.campaigns.noisy_missions --rooms legs --noises rough --seed 7

Takes half an hour.

Each seed is a mission for each room and noise, with an offset of the base and a rate of poses that
it draws. What has to hold: a mission claims no floor that its record has not, all floor that was
ever reachable is told, a mission that is done is, and none stays in one place for more than 20 s
with work left, unless it is ``blocked``, and so says what it waits for. Exit code 1 where one does
not.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from tests.campaigns.lab.building import Building
from tests.campaigns.lab.judge import Ending, Figures, judge, truth_of
from tests.campaigns.lab.known_floor import FloorAccount, account
from tests.campaigns.lab.mission import Trace, run_mission
from tests.campaigns.lab.own import NOISES
from tests.campaigns.lab.settings import LabSettings

Box = tuple[float, float, float, float]

PIXEL_M, WALL_PX = 0.05, 2
# Corners of boxes [m].
TABLE: tuple[Box, ...] = ((1.4, 1.1, 2.0, 1.6),)
LEGS: tuple[Box, ...] = tuple((x, y, x + 0.05, y + 0.05) for x in (1.4, 1.8) for y in (1.1, 1.6))
DOOR: tuple[Box, ...] = ((1.7, 0.0, 1.75, 1.2), (1.7, 1.75, 1.75, 2.6))
LEG: tuple[Box, ...] = ((1.2, 1.0, 1.25, 1.05),)
# Width and height with walls [m], and what stands there.
ROOMS: dict[str, tuple[float, float, tuple[Box, ...]]] = {
    "bare": (3.2, 2.6, ()),
    "table": (3.2, 2.6, TABLE),
    "legs": (3.2, 2.6, LEGS),
    "door": (3.2, 2.6, DOOR),
    "small": (2.2, 1.8, LEG),
}
START = Pose2D(0.7, 0.7)
LEFTS_M, RATES_HZ = (0.0, 0.03, 0.06, 0.1), (1.0, 5.0, 20.0)
LIMIT_S = 900.0
# The most that areas may differ, of the floor that was ever reachable.
MOST_SHARE = 0.01
# By how much a claim is above the truth at most, of the floor that is a pixel off walls: of what is
# beside them a map of such pixels shows nothing for certain.
MOST_EXCESS = 0.05
# A robot with work left must move by LEAVES_M [m] within LEAVES_S [s].
LEAVES_M, LEAVES_S = 0.05, 20.0


@dataclass(frozen=True, slots=True)
class NoisyMission:
    """A mission to be made: room, noise by its name, offset of the base, rate of poses, seed."""

    room: str
    noise: str
    left_m: float = 0.0
    pose_hz: float = 20.0
    seed: int = 1

    def __str__(self) -> str:
        left = f"{100 * self.left_m:.0f} cm left, {self.pose_hz:g} Hz"
        return f"{self.room}, {self.noise}, {left}, seed {self.seed}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a mission came to.

    Attributes:
        figures: of the judge of true poses.
        account: of the floor.
        stayed_s: how long it stayed in one place at most with work left and no wait announced;
            turning or not [s].
    """

    figures: Figures
    account: FloorAccount
    stayed_s: float

    @property
    def faults(self) -> list[str]:
        """What does not hold, in words."""
        of, floor = self.figures, self.account
        found = []
        if floor.overclaimed > MOST_SHARE:
            found.append(f"claims {floor.claimed:.2f} m2, its record has {floor.swept:.2f}")
        if floor.untold > MOST_SHARE:
            told = f"{floor.told_closed:.2f} m2 are told to be out of reach"
            found.append(f"{floor.closed:.2f} m2 were reachable once, {told}")
        if of.claimed_share - of.clear_share > MOST_EXCESS:
            found.append(f"claims {of.claimed_share:.1%}, {of.clear_share:.1%} off walls are swept")
        if of.ending in (Ending.DEADLOCK, Ending.LIMIT):
            found.append(f"{of.ending}: {of.state}: {of.reason}")
        if self.stayed_s > LEAVES_S:
            found.append(f"stayed where it was for {self.stayed_s:.0f} s with work left")
        return found


def building_of(room: str) -> Building:
    """Return a room as a building; its pixels lie a little beside the map frame's axes."""
    width_m, height_m, boxes = ROOMS[room]
    walls = np.ones((round(height_m / PIXEL_M), round(width_m / PIXEL_M)), bool)
    walls[WALL_PX:-WALL_PX, WALL_PX:-WALL_PX] = False
    for box in boxes:
        col0, row0, col1, row1 = (round(edge / PIXEL_M) for edge in box)
        walls[row0:row1, col0:col1] = True
    geometry = GridGeometry(*walls.shape, PIXEL_M, Pose2D(-0.013, 0.008))
    return Building(room, geometry, walls, np.zeros_like(walls), START)


def outcome_of(mission: NoisyMission) -> Outcome:
    """Make a mission, and judge it."""
    settings = LabSettings(
        seed=mission.seed,
        own=mission.noise,
        left_m=mission.left_m,
        pose_hz=mission.pose_hz,
        seconds=LIMIT_S,
    )
    run = run_mission(building_of(mission.room), settings)
    return Outcome(judge(run, truth_of(run)), account(run), stayed_s(run.trace))


def stayed_s(trace: Trace) -> float:
    """Return how long the robot stayed in one place at most, while it was not done [s].

    Not counted is the time in which the mission is ``blocked``: its reason says what it waits for.
    """
    of = trace.columns()
    begins = [state[0] for state in trace.states]
    at = np.searchsorted(begins, of["t"], side="right") - 1
    is_blocked = np.array([state[1] == "blocked" for state in trace.states])[at]
    spent = np.where(is_blocked, 0.0, np.diff(of["t"], prepend=0.0))
    most_s = here_s = 0.0
    here = math.inf, math.inf
    rows = zip(*(column.tolist() for column in (spent, of["x"], of["y"], of["done"])), strict=True)
    for passed_s, x, y, is_done in rows:
        here_s += passed_s
        if is_done or math.dist(here, (x, y)) > LEAVES_M:
            here, here_s = (x, y), 0.0
        most_s = max(most_s, here_s)
    return most_s


def drawn(seeds: range, rooms: list[str], noises: list[str]) -> Iterator[NoisyMission]:
    """Yield the missions of some seeds."""
    for seed, room, noise in itertools.product(seeds, rooms, noises):
        rng = np.random.default_rng((seed, list(ROOMS).index(room), list(NOISES).index(noise)))
        left_m, rate_hz = rng.choice(LEFTS_M), rng.choice(RATES_HZ)
        yield NoisyMission(room, noise, float(left_m), float(rate_hz), seed)


def main() -> int:
    """Run missions; print a line each, and what does not hold."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1, help="the first one")
    parser.add_argument("--seeds", type=int, default=1, metavar="N")
    parser.add_argument("--rooms", nargs="+", default=list(ROOMS), choices=ROOMS)
    parser.add_argument("--noises", nargs="+", default=list(NOISES), choices=NOISES)
    args = parser.parse_args()
    bad = count = 0
    seeds = range(args.seed, args.seed + args.seeds)
    for mission in drawn(seeds, args.rooms, args.noises):
        found = outcome_of(mission)
        of, floor, faults = found.figures, found.account, found.faults
        count, bad = count + 1, bad + bool(faults)
        in_vain = of.claimed_unswept_m2 / floor.ever
        print(
            f"{mission}: {of.ending}, {of.seconds:.0f} s, swept {of.true_share:.1%}, off walls "
            f"{of.clear_share:.1%}, claimed {of.claimed_share:.1%}, in vain {in_vain:.2%}; "
            f"claimed beyond the record {floor.overclaimed:.2%}, untold {floor.untold:.2%}, stayed "
            f"{found.stayed_s:.0f} s, {of.contacts} contacts",
            flush=True,
        )
        for fault in faults:
            print(f"  FAULT: {fault}", flush=True)
    print(f"{bad} of {count} missions with faults")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
