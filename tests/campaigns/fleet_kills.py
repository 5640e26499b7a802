"""Daemons of a fleet that are killed or frozen, and networks that split.

    python -m tests.campaigns.fleet_kills --kills 200 --splits 20

Takes hours.

Three daemons share a building over three routers in a row, one robot at each end's and one more at
the last's. At random moments a daemon is killed (kill -9), or stopped with its token in place
(SIGSTOP), or the router between is killed, so that two fleets result. Each time the remaining cells
have to be divided among those that are left within ten seconds, and anew within fifteen once the
robot or the network is back. In the end every cell has to be swept. A killed daemon's robot stands
from that moment on; half of them come back. Exit code 1 if anything of this does not hold.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from fasaco_edge.bench.processes import warm_kernels
from tests.campaigns.services import show
from tests.fleet.robots import FleetRobot
from tests.support.outsider import TIMEOUT_S
from tests.support.processes import Daemon, daemon_process, free_endpoint
from tests.support.rooms import WALL, Cell, coverable_cells, fill, room
from tests.support.router import router_process
from tests.support.waiting import until

# A building of three rooms along a corridor.
FLOOR = fill(room(12.0, 8.0), 0.0, 5.0, 12.0, 5.1, WALL)
for x_m in (1.6, 5.6, 9.6):
    FLOOR = fill(FLOOR, x_m, 5.0, x_m + 1.0, 5.1, 0)
for x_m in (4.0, 8.0):
    FLOOR = fill(FLOOR, x_m, 5.0, x_m + 0.1, 8.0, WALL)
STARTS = {"r1": (0.75, 0.75), "r2": (11.25, 0.75), "r3": (6.15, 7.05)}
# Time for a cell: a robot of 6 m/s, so that a mission takes half a minute.
STEP_S = 0.05
# A robot whose daemon waits for a map publishes it again, as a mapper does, each [s].
MAP_S = 1.0
# Time within which a part must be taken over [s].
TAKEN_OVER_S = 10.0
# Longest time between two events [s].
CALM_S = 6.0
# A robot that comes back soon after it left is given a part after ten seconds (``EVEN_S`` of the
# fleet's layer), so that one that comes and goes does not change all paths each time.
UNITED_S = 15.0
AT_WORK = ("covering", "planning")

Event = Literal["kill", "freeze", "split"]


@dataclass
class Campaign:
    """What was seen.

    Attributes:
        taken_over_s: after each event, until those that are left had divided the rest [s].
        united_s: after each return, until all had one division [s].
        twice: of each mission, the share of cells that two or more robots swept.
        patience: how many times as long as it should something may take.
        violations: what did not hold.
    """

    patience: float = 1.0
    taken_over_s: dict[str, list[float]] = field(default_factory=dict)
    united_s: list[float] = field(default_factory=list)
    twice: list[float] = field(default_factory=list)
    counted: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)

    def figures(self) -> dict[str, Any]:
        """Return all as figures."""

        def told(times: list[float]) -> dict[str, float]:
            return {
                "median_s": round(statistics.median(times), 2),
                "most_s": round(max(times), 2),
            }

        return {
            **self.counted,
            "taken_over": {kind: told(times) for kind, times in self.taken_over_s.items()},
            "united": told(self.united_s) if self.united_s else {},
            "swept_twice": round(statistics.mean(self.twice), 3) if self.twice else None,
            "violations": self.violations,
        }


class House:
    """Routers, daemons and robots of one mission."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self._folder, self._stack = folder, stack
        # The router between is known to both, and knows both.
        self._ends = free_endpoint(), free_endpoint()
        self._between = self._start(router_process(free_endpoint(), *self._ends), ends=True)
        self.sides = {"r1": 0, "r2": 1, "r3": 1}
        self.daemons: dict[str, Daemon] = {}
        self.robots: dict[str, FleetRobot] = {}
        # Robots whose daemon is gone.
        self.standing: set[str] = set()
        self.cells = coverable_cells(FLOOR)
        self._mapped_at = time.monotonic()
        for name in STARTS:
            (folder / name).mkdir()
            self.start(name)
        for name, at in STARTS.items():
            robot = FleetRobot(self._ends[self.sides[name]], name, FLOOR, at)
            self.robots[name] = robot
            stack.callback(robot.seat.session.close)
        for robot in self.robots.values():
            robot.seat.wait_status(lambda status: status["state"] in AT_WORK)

    def _start(self, router: Any, *, ends: bool = False) -> ExitStack:
        if ends:
            for endpoint in self._ends:
                self._stack.enter_context(router_process(endpoint))
        between = ExitStack()
        between.enter_context(router)
        self._stack.callback(between.close)
        return between

    def start(self, name: str) -> None:
        """Start a robot's daemon; a later one goes on with its progress."""
        bus = {"mode": "client", "listen": [], "connect": [self._ends[self.sides[name]]]}
        process = daemon_process(
            self._folder / name, bus=bus, robot={"name": name}, fleet={"name": "house"}
        )
        self.daemons[name] = self._stack.enter_context(process)

    def come_back(self, name: str) -> None:
        """Start the daemon of a robot that stands, and give it what it needs."""
        self.start(name)
        seat = self.robots[name].seat
        until(seat.alive, TIMEOUT_S, why=lambda: f"{name} does not come back")
        self.robots[name].look()
        self.standing.discard(name)

    def split(self) -> None:
        """Kill the router between."""
        self._between.close()

    def heal(self) -> None:
        """Start another router between."""
        self._between = self._start(router_process(free_endpoint(), *self._ends))

    def tick(self) -> None:
        """Let every robot drive a cell."""
        is_due = time.monotonic() - self._mapped_at > MAP_S
        for name, robot in self.robots.items():
            if name in self.standing:
                continue
            robot.go()
            if is_due and self.statuses([name])[name]["state"] == "waiting for map":
                robot.look()
                self._mapped_at = time.monotonic()
        time.sleep(STEP_S)

    def until(self, holds: Callable[[], bool], most_s: float) -> float:
        """Let robots drive until something holds; return the time it took [s], or inf."""
        began = time.monotonic()
        while not holds():
            if time.monotonic() - began > most_s:
                return float("inf")
            self.tick()
        return time.monotonic() - began

    def statuses(self, names: Collection[str]) -> dict[str, dict[str, Any]]:
        """Return the newest status of robots."""
        return {name: self.robots[name].seat.status.heard[-1].json() for name in names}

    def is_done(self, names: Collection[str]) -> bool:
        """Return whether robots are done."""
        return all(status["state"] == "done" for status in self.statuses(names).values())

    def is_shared(self, names: Collection[str]) -> bool:
        """Return whether the whole building is divided among robots, or swept."""
        statuses = self.statuses(names)
        if all(status["state"] == "done" for status in statuses.values()):
            return True
        at_work = [s["fleet"] for s in statuses.values() if s["state"] in AT_WORK]
        parts = [fleet["part_cells"] for fleet in at_work]
        if len(parts) == 1 and parts[0] is None:
            return True
        is_one = len({fleet["division"] for fleet in at_work}) == 1
        return is_one and None not in parts and sum(parts) >= len(self.cells)


@contextmanager
def house(folder: Path) -> Iterator[House]:
    """Start everything; end it in the end."""
    with ExitStack() as stack:
        yield House(folder, stack)


def run_campaign(
    folder: Path,
    counts: dict[Event, int],
    seed: int = 0,
    say: Callable[[str], None] = show,
    patience: float = 1.0,
) -> Campaign:
    """Let so much go wrong, a few events a mission; return what was seen."""
    warm_kernels()
    rng, campaign, left = random.Random(seed), Campaign(patience), Counter(counts)
    while (total := left.total()) and campaign.counted["missions"] < 4 * sum(counts.values()):
        place = folder / f"mission{campaign.counted['missions']}"
        place.mkdir()
        known = len(campaign.violations)
        with house(place) as there:
            _one_mission(campaign, there, rng, left)
        campaign.counted["missions"] += 1
        for violation in campaign.violations[known:]:
            say(violation)
        say(f"{total} events left; {len(campaign.violations)} violations")
    return campaign


def _one_mission(
    campaign: Campaign, there: House, rng: random.Random, left: Counter[Event]
) -> None:
    """Let things go wrong until the mission is done, or nothing is left that may."""
    everybody = set(there.robots)
    there.until(lambda: there.is_shared(everybody), TAKEN_OVER_S)
    while kinds := [kind for kind, count in sorted(left.items()) if count]:
        there.until(lambda: False, rng.uniform(0.0, CALM_S))
        alive = sorted(everybody - there.standing)
        if there.is_done(alive) or len(alive) < 2:
            break
        kind = rng.choice(kinds)
        left[kind] -= 1
        campaign.counted[kind] += 1
        if kind == "split":
            _split(campaign, there, rng)
        else:
            _lose(campaign, there, rng.choice(alive), kind, comes_back=rng.random() < 0.5, rng=rng)
    alive = sorted(everybody - there.standing)
    # From the last event on, as the checks after each event may take as long on a busy machine.
    took_s = there.until(lambda: there.is_done(alive), TIMEOUT_S)
    if took_s == float("inf"):
        campaign.violations.append(f"not done: {_told(there, alive)}")
    swept = Counter[Cell](cell for robot in there.robots.values() for cell in robot.swept)
    if missing := there.cells - swept.keys():
        campaign.violations.append(f"{len(missing)} cells not swept: {sorted(missing)[:9]}")
    campaign.twice.append(sum(count > 1 for count in swept.values()) / len(there.cells))
    for name, status in there.statuses(alive).items():
        if status["errors"]["total"]:
            campaign.violations.append(f"{name}: {status['errors']}")


def _lose(
    campaign: Campaign,
    there: House,
    name: str,
    kind: Event,
    *,
    comes_back: bool,
    rng: random.Random,
) -> None:
    """Kill or freeze a daemon; let it come back or not."""
    others = sorted(set(there.robots) - there.standing - {name})
    process = there.daemons[name].process
    process.send_signal(signal.SIGKILL if kind == "kill" else signal.SIGSTOP)
    there.standing.add(name)
    _check_shared(campaign, there, kind, others)
    if kind == "freeze":
        there.until(lambda: False, rng.uniform(0.0, CALM_S / 2))
        process.send_signal(signal.SIGCONT)
        there.standing.discard(name)
    elif comes_back:
        process.wait()
        there.come_back(name)
    else:
        return
    campaign.counted["returns"] += 1
    _check_united(campaign, there, name)


def _split(campaign: Campaign, there: House, rng: random.Random) -> None:
    """Split the network, and heal it."""
    there.split()
    standing = there.standing
    sides = [
        [n for n, side in there.sides.items() if side == s and n not in standing] for s in (0, 1)
    ]
    _check_shared(campaign, there, "split", *filter(None, sides))
    there.until(lambda: False, rng.uniform(0.0, CALM_S / 2))
    there.heal()
    _check_united(campaign, there, "the network")


def _check_shared(campaign: Campaign, there: House, kind: str, *sides: list[str]) -> None:
    """Check that the robots of each side take over what is left in time."""
    names = sorted(name for side in sides for name in side)
    most_s = campaign.patience * TAKEN_OVER_S
    took_s = there.until(lambda: all(there.is_shared(side) for side in sides), most_s)
    if took_s > most_s:
        campaign.violations.append(f"{kind}: not taken over: {_told(there, names)}")
    elif there.is_done(names):
        campaign.counted["done before"] += 1
    else:
        campaign.taken_over_s.setdefault(kind, []).append(took_s)


def _check_united(campaign: Campaign, there: House, what: str) -> None:
    """Check that all have one division soon."""
    names = sorted(set(there.robots) - there.standing)
    took_s = there.until(lambda: there.is_shared(names), campaign.patience * UNITED_S)
    if took_s > campaign.patience * UNITED_S:
        campaign.violations.append(f"not united after {what} came back: {_told(there, names)}")
    else:
        campaign.united_s.append(took_s)


def _told(there: House, names: Collection[str]) -> str:
    return "; ".join(
        f"{name} {status['state']} ({status['reason']}), division {status['fleet']['division']}, "
        f"part {status['fleet']['part_cells']}, "
        + ", ".join(f"{m['name']} {m['away'] or m['state']}" for m in status["fleet"]["members"])
        for name, status in there.statuses(names).items()
    )


def main() -> int:
    """Run the campaign, and print its figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=200, help="(default: %(default)s)")
    parser.add_argument("--freezes", type=int, default=20, help="(default: %(default)s)")
    parser.add_argument("--splits", type=int, default=20, help="(default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    counts: dict[Event, int] = {
        "kill": args.kills, "freeze": args.freezes, "split": args.splits,
    }  # fmt: skip
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fleet-kills-") as folder:
        campaign = run_campaign(Path(folder), counts, args.seed)
    figures = {**campaign.figures(), "wall_s": round(time.monotonic() - began)}
    print(json.dumps(figures, indent=1))
    return int(bool(campaign.violations))


if __name__ == "__main__":
    sys.exit(main())
