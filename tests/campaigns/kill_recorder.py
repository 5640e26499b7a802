"""Recorders killed with SIGKILL at random moments, and what is left of their files.

    python -m tests.campaigns.kill_recorder --kills 100 [--seed 0]

Takes minutes.

A robot drives at 50 poses a second, among maps, coverage and statuses. After each kill all parts
are to be read by rerun, as they are or after the next recorder's repair; the age that the newest
pose on the disk had at the kill is what was lost. Exit code 1 where that is more than a second.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fasaco_edge.bus.session import Bus
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.recording.read.torn import repair_folder
from tests.support.recordings import begun_parts, bus_on_free_port, read_column, recorder_process
from tests.support.scripted_mission import Mission

GOAL_LOST_S = 1.0
POSES_HZ, FRAMES = 50, 400
# It lives so long at least and at most [s].
LIFE_S = (1.5, 4.0)
# Small, so that some are killed while one part gives way to the next.
PART_BYTES = 300_000


@dataclass(frozen=True, slots=True)
class Kill:
    """What was left.

    Attributes:
        parts: files.
        torn: of these, how many the repair had to cut.
        drawn_lost_s: age of the newest pose that is drawn [s].
        heard_lost_s: age of the newest pose as the mission received it [s].
    """

    parts: int
    torn: int
    drawn_lost_s: float
    heard_lost_s: float


@contextmanager
def driving(bus: Bus) -> Iterator[None]:
    """Let a robot drive, over and over again."""
    mission, over = Mission(bus), threading.Event()

    def drive() -> None:
        while not over.is_set():
            for done in mission.frames(FRAMES):
                if int(done * FRAMES) % POSES_HZ == 0:
                    mission.publish_status("covering", done, planning=False)
                if over.wait(1 / POSES_HZ):
                    return

    thread = threading.Thread(target=drive)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def kill_once(bus: Bus, endpoint: str, folder: Path, life_s: float) -> Kill:
    """Let a recorder live so long [s], kill it, and read what it wrote into ``folder``."""
    with recorder_process(bus, endpoint, folder, part_bytes=PART_BYTES) as recorder:
        time.sleep(life_s)
        killed_ns = time.time_ns()
        recorder.process.kill()
        recorder.process.wait()
    torn = len(repair_folder(folder))
    parts = begun_parts(folder)
    drawn_ns = [
        int(at_ns)
        for part in parts
        for at_ns in read_column(part, entities.ROBOT, "Transform3D:translation").wall_ns
    ]
    heard_ns = [
        sample.wall_ns
        for part in parts
        if read_column(part, entities.INPUTS, BATCH).values
        for sample in RecordedSamples([part])
        if sample.topic == "pose"
    ]
    return Kill(
        len(parts),
        torn,
        *((killed_ns - max(times, default=0)) / 1e9 for times in (drawn_ns, heard_ns)),
    )


BATCH = f"{entities.INPUTS_ARCHETYPE}:{entities.INPUTS_COMPONENT}"


def run_campaign(kills: int, seed: int) -> Iterator[Kill]:
    """Kill so many recorders, one after the other."""
    rng = random.Random(seed)
    with bus_on_free_port() as (bus, endpoint), driving(bus):
        for _ in range(kills):
            with tempfile.TemporaryDirectory() as folder:
                yield kill_once(bus, endpoint, Path(folder), rng.uniform(*LIFE_S))


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    kills = []
    for kill in run_campaign(args.kills, args.seed):
        kills.append(kill)
        print(kill, flush=True)
    worst = max(max(kill.drawn_lost_s, kill.heard_lost_s) for kill in kills)
    late = sum(max(kill.drawn_lost_s, kill.heard_lost_s) > GOAL_LOST_S for kill in kills)
    torn, parts = sum(kill.torn for kill in kills), sum(kill.parts for kill in kills)
    print(f"{len(kills)} kills, {parts} parts, all read, {torn} after their torn end was cut")
    print(f"lost at most {worst:.2f} s, {late} times more than {GOAL_LOST_S:g} s")
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
