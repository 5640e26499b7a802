"""A disk that fills up under a recorder again and again.

    python -m tests.campaigns.recorder_disk --episodes 20

Takes minutes.

The disk is a tmpfs of 24 megabytes, which takes the right to mount. Each episode fills it all at
once, waits until the recorder says so, makes room, and waits until it records again. In the end
all parts are to be read, each episode to have been told once, on the log and in the recording.
Exit code 1 where one is not.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fasaco_edge.recording import entities
from tests.campaigns.kill_recorder import driving
from tests.support.disks import small_disk
from tests.support.recordings import bus_on_free_port, read_column, read_summary, recorder_process

DISK = "24m"
# So little is left of the room when the disk is filled [bytes].
LEFT_BYTES = 9000
# Between one episode and the next [s].
CALM_S = 1.2


@dataclass(frozen=True, slots=True)
class Episodes:
    """What so many full disks left.

    Attributes:
        parts: parts, all of which were read.
        rows: poses that are drawn in them.
        on_log, in_recording: how often the disk was said to be full.
        lost: samples that were not written, by the recorder's word.
        rss_mb: memory at the end of each episode [MB].
        exit_code: of the recorder.
    """

    parts: int
    rows: int
    on_log: int
    in_recording: int
    lost: int
    rss_mb: list[float]
    exit_code: int


def run_episodes(disk: Path, episodes: int) -> Episodes:
    """Fill ``disk`` so many times."""
    ballast, rss_mb = disk / "ballast", []
    with (
        bus_on_free_port() as (bus, endpoint),
        driving(bus),
        recorder_process(bus, endpoint, disk, least_free_bytes=0) as recorder,
    ):
        for _ in range(episodes):
            time.sleep(CALM_S)
            room = os.statvfs(disk)
            # The recorder may have taken some of it meanwhile: then it is full, too.
            with suppress(OSError):
                ballast.write_bytes(bytes(max(room.f_bavail * room.f_bsize - LEFT_BYTES, 0)))
            recorder.wait_until(lambda report: report["state"] == "disk full")
            ballast.unlink()
            again = recorder.wait_until(lambda report: report["state"] == "recording")
            rss_mb.append(again["rss_mb"])
        recorder.process.terminate()
        _, log = recorder.process.communicate(timeout=20)
    parts = sorted(disk.glob("*.rrd"))
    states = [
        (int(at_ns), state[0])
        for part in parts
        for column in [read_column(part, entities.RECORDER_STATE, "StateChange:state")]
        for at_ns, state in zip(column.wall_ns, column.values, strict=True)
    ]
    return Episodes(
        parts=len(parts),
        rows=sum(read_summary(part).rows.get(entities.ROBOT, 0) for part in parts),
        on_log=sum("disk full:" in line for line in log.splitlines()),
        in_recording=len({at_ns for at_ns, state in states if state == "disk full"}),
        lost=recorder.reports[-1]["lost"],
        rss_mb=rss_mb,
        exit_code=recorder.process.returncode,
    )


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=20)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, small_disk(Path(folder), DISK) as disk:
        done = run_episodes(disk, args.episodes)
    print(done)
    told_once = done.on_log == done.in_recording == args.episodes
    return 0 if told_once and done.exit_code == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
