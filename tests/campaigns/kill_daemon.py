"""A daemon that is killed again and again while its robot drives.

    python -m tests.campaigns.kill_daemon --kills 200

Takes a quarter of an hour.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import shutil
import signal
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fasaco_edge.bench.processes import warm_kernels
from fasaco_edge.daemon.ledger.file import LedgerFile, LoadedLedger
from tests.campaigns.roaming import Robot, Trail, entries, roaming_robot
from tests.support.ledgers import CELL_M, Cell, visits_of
from tests.support.outsider import Outsider
from tests.support.processes import Daemon, daemon_process

# At so small a distance from the border of "under the tool", rounding may decide.
DOUBT_M = 0.01
LONGEST_RUN_S = 2.5
# Of the kills, so many come while the daemon still starts.
EARLY_SHARE = 0.15
MOST_LOST_S = 1.0


@dataclass
class Campaign:
    """What was seen so far.

    Attributes:
        known: cells that were on disk after the kill before.
        lost_s: of each kill, since when a cell was covered that was not on disk [s]; 0 if none.
    """

    folder: Path
    known: set[Cell] = field(default_factory=set)
    lost_s: list[float] = field(default_factory=list)
    lost_cells: list[int] = field(default_factory=list)
    counted: Counter[str] = field(default_factory=Counter)

    def check_restart(self, status: dict[str, Any]) -> None:
        """Check that a new daemon has taken over all there was, and nothing else."""
        assert status["ledger"]["restored_cells"] == len(self.known), status["ledger"]
        assert status["ledger"]["fault"] is None, status["ledger"]
        self.counted["resumed"] += 1

    def check_kill(self, trail: Trail, since_s: float, heard_s: float, killed_s: float) -> None:
        """Check what is on disk against the true trail.

        Args:
            trail: of the robot.
            since_s: when the check before was.
            heard_s: from when on this daemon received poses; inf if it never did.
            killed_s: when it was killed.
        """
        self.counted["torn writes"] += (self.folder / "robot.ledger.new").exists()
        found = self._found()
        assert found.fault is None, found.fault
        on_disk = set(visits_of(found.ledger)) if found.ledger else set()
        assert self.known <= on_disk, f"forgotten: {sorted(self.known - on_disk)}"
        touched = set(entries(trail.between(since_s, killed_s), -DOUBT_M))
        invented = on_disk - self.known - touched
        assert not invented, f"invented: {sorted(invented)}"
        heard = [point for point in trail.between(heard_s, killed_s) if point[3]]
        missing = {cell: at for cell, at in entries(heard, DOUBT_M).items() if cell not in on_disk}
        self.lost_s.append(killed_s - min(missing.values(), default=killed_s))
        self.lost_cells.append(len(missing))
        assert self.lost_s[-1] <= MOST_LOST_S, f"lost {self.lost_s[-1]:.3f} s: {missing}"
        self.counted["new cells"] += len(on_disk - self.known)
        self.known = on_disk

    def _found(self) -> LoadedLedger:
        """Look at a copy: to finish a write that was cut short is for the next daemon."""
        with tempfile.TemporaryDirectory() as folder:
            copied = shutil.copytree(self.folder, Path(folder, "copy"))
            return LedgerFile(copied, "robot").load(CELL_M)


def run_campaign(folder: Path, kills: int, map_name: str, seed: int = 0) -> dict[str, Any]:
    """Kill a daemon so often at random moments; check what it knows afterwards.

    Each time it must go on with all that it had on disk, must have lost no more than the
    last second of what it received, and must know of no cell the robot was not in. The robot
    drives on while there is no daemon. Returns figures.
    """
    rng, totals = random.Random(seed), Counter[str]()
    lost_s: list[float] = []
    lost_cells: list[int] = []
    warm_kernels()
    while totals["kills"] < kills:
        state = folder / f"mission{totals['missions']}"
        state.mkdir()
        with roaming_robot(map_name) as (robot, endpoint):
            campaign = Campaign(state)
            _one_mission(campaign, robot, endpoint, rng, kills - totals["kills"])
        lost_s += campaign.lost_s
        lost_cells += campaign.lost_cells
        totals += campaign.counted + Counter({"kills": len(campaign.lost_s), "missions": 1})
    lossy = [seconds for seconds in lost_s if seconds]
    return {
        **totals,
        "invented_cells": 0,
        "lost_s_max": round(max(lost_s), 3),
        "lost_s_mean_of_losses": round(sum(lossy) / max(len(lossy), 1), 3),
        "kills_that_lost_a_cell": len(lossy),
        "lost_cells_max": max(lost_cells),
    }


def _one_mission(
    campaign: Campaign, robot: Robot, endpoint: str, rng: random.Random, kills: int
) -> None:
    """Kill daemons until the mission is done, or so many were killed."""
    checked_s = time.monotonic()
    bus = {"mode": "client", "listen": [], "connect": [endpoint]}
    for _ in range(kills):
        early = rng.random() < EARLY_SHARE
        with daemon_process(campaign.folder, "--state", str(campaign.folder), bus=bus) as daemon:
            status: dict[str, Any] = {}
            heard_s = math.inf
            if early:
                time.sleep(rng.uniform(0.0, 1.0))
            else:
                with Outsider(endpoint) as outsider:
                    campaign.check_restart(outsider.ask_status())
                    status = outsider.wait_status(_knows_where)
                    heard_s = time.monotonic()
                    time.sleep(rng.uniform(0.0, LONGEST_RUN_S))
            killed_s = _kill(daemon)
        campaign.check_kill(robot.trail, checked_s, heard_s, killed_s)
        campaign.counted["while starting"] += early
        checked_s = killed_s
        if status.get("state") == "done":
            return


def _kill(daemon: Daemon) -> float:
    killed_s = time.monotonic()
    daemon.process.send_signal(signal.SIGKILL)
    daemon.process.wait()
    return killed_s


def _knows_where(status: dict[str, Any]) -> bool:
    return status["state"] in ("planning", "covering", "blocked", "done")


def main() -> None:
    """Run the campaign and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--map", default="basement")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        figures = run_campaign(Path(folder), args.kills, args.map, args.seed)
        figures["wall_s"] = round(time.monotonic() - started)
        print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
