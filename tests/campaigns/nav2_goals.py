"""Coverage lines driven by a look-alike of Nav2: aborts, delays, restarts, lost replies.

    python -m tests.campaigns.nav2_goals [--missions 50] [--length 40] [--speed 1] [--seed 0]

Takes half an hour.

It prints a row for each mission, and what became of all; ``--at-once 4`` missions run at a time,
and ``--faults`` chooses what goes wrong. A mission is part of a line over a bundled map,
``--length`` metres long; daemon, path and status are stood in for, the follower and the look-alike
are processes that hardly work: several missions at once disturb each other little.
"""

from __future__ import annotations

import argparse
import itertools
import math
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import fasaco_edge as fe
from tests.follow.nav2_missions import Point, Robot, kind_of, nav2_follower, passed
from tests.support.driven_base import DrivenBase

LIMIT_S = 600.0
FAULTS: dict[str, dict[str, float]] = {
    "none": {},
    "delays of a second": {"delay_s": 1.0},
    "aborts": {"abort_every_s": 8.0},
    "restarts": {"restart_every_s": 15.0},
    "lost replies": {"lost": 0.2},
    "all": {"delay_s": 1.0, "abort_every_s": 15.0, "restart_every_s": 30.0, "lost": 0.05},
}


@dataclass(frozen=True)
class Mission:
    """What became of one.

    Attributes:
        faults: which were made.
        complete: whether the end was reached, and all before it passed in order.
        again_m: how much more was driven than the line is long [m].
        standing: share of the time that the robot stood between goals that succeeded.
        figures: what the look-alike counted.
    """

    faults: str
    complete: bool
    again_m: float
    standing: float
    figures: dict[str, Any]


def line_of(length_m: float, seed: int) -> list[Point]:
    """Return a part of the line over a bundled map."""
    plan = fe.plan(fe.load_map("office"), search=fe.Search(seed=1, budget_s=0.2))
    xy = np.asarray(plan.xy)
    first = int(np.random.default_rng(seed).integers(0, len(xy) // 2))
    points: list[Point] = [(float(xy[first][0]), float(xy[first][1]))]
    way = 0.0
    for x, y in xy[first + 1 :]:
        way += math.dist(points[-1], (x, y))
        points.append((float(x), float(y)))
        if way >= length_m:
            break
    return points


def run_mission(faults: str, length_m: float, speed_m_s: float, seed: int) -> Mission:
    """Drive one line to its end."""
    line = line_of(length_m, seed)
    base, domain = DrivenBase(), 7 if seed % 2 else None
    base.says_poses = False
    robot = {
        "endpoint": base.endpoint, "domain": domain, "start": line[0], "speed": speed_m_s,
        "seed": seed, **FAULTS[faults],
    }  # fmt: skip
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            Robot(**robot) as nav2,
            nav2_follower(Path(folder), base.endpoint, kind_of(domain), speed_m_s=speed_m_s) as log,
        ):
            base.plans()
            base.send_path(*line)
            ends = time.monotonic() + LIMIT_S / speed_m_s
            while "standing, the path is driven" not in (said := log.read_text()):
                if time.monotonic() > ends:
                    break
                time.sleep(0.1)
        done = nav2.end()
    finally:
        base.close()
    trail = done.pop("trail")
    is_there = "standing, the path is driven" in said
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(line))
    whole_s = done["driving_s"] + done["standing_s"]
    return Mission(
        faults,
        # Where Nav2 cuts corners, or is done by its tolerance, the tool has still been.
        is_there and done["refused"] == [] and passed(trail, line, near=0.25),
        done["driven_m"] - length,
        done["standing_s"] / max(whole_s, 1e-9),
        {"log": said, **done},
    )


def show(number: int, mission: Mission) -> None:
    """Print the row of a mission."""
    figures = {name: value for name, value in mission.figures.items() if name != "log"}
    print(
        f"{number:3} {mission.faults:20} {'complete' if mission.complete else 'NOT COMPLETE':12}"
        f" again {mission.again_m:6.2f} m  standing {mission.standing:6.2%}  {figures}",
        flush=True,
    )
    if not mission.complete:
        print(mission.figures["log"], flush=True)


def main() -> None:
    """Run missions, the faults in turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--missions", type=int, default=50)
    parser.add_argument("--length", type=float, default=40.0)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", choices=list(FAULTS), help="of all missions, not in turn")
    parser.add_argument("--at-once", type=int, default=1, help="missions beside each other")
    args = parser.parse_args()
    missions = []

    def run(number: int) -> Mission:
        faults = args.faults or list(FAULTS)[number % len(FAULTS)]
        return run_mission(faults, args.length, args.speed, args.seed + number)

    with ThreadPoolExecutor(args.at_once) as pool:
        for number, mission in enumerate(pool.map(run, range(args.missions))):
            missions.append(mission)
            show(number, mission)
    complete = sum(mission.complete for mission in missions)
    print(f"{complete} of {len(missions)} complete")
    for faults in FAULTS:
        those = [mission for mission in missions if mission.faults == faults]
        if those:
            standing = np.array([mission.standing for mission in those])
            again = max(mission.again_m for mission in those)
            print(
                f"{faults:20} standing mean {standing.mean():.2%}, most {standing.max():.2%}; again"
                f" at most {again:.2f} m"
            )


if __name__ == "__main__":
    main()
