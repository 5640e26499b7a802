"""Benchmarks for developers of the planner: ``python -m tests.benchmarks NAME``.

Users measure on their robot by ``fasaco-edge bench``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fasaco_edge.bench.benchmark import Benchmark
from fasaco_edge.cli import run_command
from fasaco_edge.cli.bench import EPILOG, add_benchmarks
from fasaco_edge.cli.console.parser import Parser
from tests.benchmarks.ants.benchmark import ANTS
from tests.benchmarks.fleets.benchmark import FLEET_ONLINE
from tests.benchmarks.floor import FLOOR
from tests.benchmarks.full import FULL
from tests.benchmarks.online.benchmark import ONLINE
from tests.benchmarks.peers import PEERS
from tests.benchmarks.quality import QUALITY
from tests.benchmarks.replan import REPLAN
from tests.benchmarks.rooms.benchmark import ROOMS
from tests.benchmarks.rooms.identity import ROOM_IDS
from tests.benchmarks.rooms.one_by_one import BY_ROOM
from tests.benchmarks.table1.benchmark import TABLE1
from tests.benchmarks.turns.benchmark import TURNS

BENCHMARKS: tuple[Benchmark[Any], ...] = (
    TABLE1, QUALITY, TURNS, FLOOR, PEERS, REPLAN, FULL, ANTS, FLEET_ONLINE, ONLINE, ROOMS,
    ROOM_IDS, BY_ROOM,
)  # fmt: skip
# What each takes with its defaults, on two cores; the short form of each is a test.
TAKES = {
    "table1": "half an hour", "quality": "2 minutes", "turns": "a minute", "floor": "minutes",
    "peers": "half an hour", "replan": "minutes", "full": "minutes", "ants": "minutes",
    "fleet-online": "half an hour", "online": "half an hour", "rooms": "a minute",
    "room-ids": "minutes", "by-room": "half an hour",
}  # fmt: skip


def with_duration(benchmark: Benchmark[Any]) -> str:
    """Return what a benchmark measures, and how long that takes."""
    return f"{benchmark.summary} ({TAKES[benchmark.name]})"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one benchmark and return the process's exit code."""
    parser = Parser(
        prog="python -m tests.benchmarks",
        description="Measure planner and whole missions in simulation.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_benchmarks(parser, [replace(one, summary=with_duration(one)) for one in BENCHMARKS])
    return run_command(parser, sys.argv[1:] if argv is None else argv)


if __name__ == "__main__":
    sys.exit(main())
