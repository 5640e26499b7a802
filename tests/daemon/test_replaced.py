"""Missions that are replaced again and again: what the last one used is released."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from itertools import chain
from pathlib import Path

import pytest

from fasaco_edge.host.processes import own_mb
from tests.daemon.test_mask_topic import MISSION, put_mask
from tests.daemon.test_service import rewritten, service
from tests.support.outsider import Outsider
from tests.support.rooms import FREE, WALL, fill, room, show_room
from tests.support.waiting import until

# Number of replacements until all caches are full, and of measured ones after that.
FIRST, MEASURED = 20, 40
# What one may keep, on average [MB]. After the first, memory grows by 1 to 4 MB and then no more;
# with each mission kept it would grow by 9 MB.
KEPT_MB = 0.15
ROOM = room(16.0, 12.0)
BLANK = fill(ROOM, 0.0, 0.0, 16.0, 12.0, FREE)


@dataclass(frozen=True)
class Held:
    """What a process holds; memory is [MB]."""

    children: int
    threads: int
    descriptors: int
    resident: float


def held_by(pid: int) -> Held:
    process = Path(f"/proc/{pid}")
    threads = list((process / "task").iterdir())
    children = (thread / "children" for thread in threads)
    return Held(
        len(list(chain.from_iterable(file.read_text().split() for file in children))),
        len(threads),
        len(list((process / "fd").iterdir())),
        own_mb(pid),
    )


def squares() -> Iterator[tuple[float, float, float, float]]:
    """Yield squares in the room, each another one than the last (west, south, east, north) [m]."""
    for number in range(FIRST + MEASURED):
        x = 2.0 + 0.05 * (number % 60)
        yield x, 2.0, x + 1.0, 3.0


def wait_replaced(outsider: Outsider, config: Callable[[dict], bool]) -> None:
    def holds() -> bool:
        status = outsider.ask_status()
        return config(status["config"]["mission"]) and status["state"] == "covering"

    until(holds)


def reload(running, outsider, square):
    west, south, east, north = square
    corners = [[west, south], [east, south], [east, north], [west, north]]
    rewritten(running, mission={"keep_out": [corners]})
    wait_replaced(outsider, lambda mission: mission["keep_out"] == [corners])


def send_mask(running, outsider, square):
    before = outsider.ask_status()["config"]["mission"]["keep_out_mask"]
    put_mask(outsider, fill(BLANK, *square, WALL))
    wait_replaced(outsider, lambda mission: mission["keep_out_mask"] not in ("", before))


@pytest.mark.parametrize("replace", [reload, send_mask])
def test_a_replaced_mission_releases_its_memory(tmp_path, replace):
    mission = {} if replace is reload else dict(MISSION)
    with (
        service(tmp_path, mission=mission, executed=True) as (running, _),
        Outsider(running.endpoint) as outsider,
    ):
        show_room(outsider, ROOM, 0.75, 0.75)
        if replace is send_mask:
            put_mask(outsider, BLANK)
        outsider.wait_status(lambda status: status["state"] == "covering")
        for number, square in enumerate(squares(), 1):
            if number == FIRST + 1:
                before = held_by(running.pid)
            replace(running, outsider, square)
        # A thread that is interrupted ends within some tenths of a second of a quiet machine.
        until(
            lambda: not kept(before, held_by(running.pid)),
            60.0,
            why=lambda: kept(before, held_by(running.pid)),
        )
        print(f"{replace.__name__}: {before}, after {MEASURED} more {held_by(running.pid)}")


def kept(before: Held, after: Held) -> list[str]:
    most = Held(
        children=0,
        threads=before.threads + 2,  # Zenoh starts and ends some of its own
        descriptors=before.descriptors,
        resident=before.resident + KEPT_MB * MEASURED,
    )
    pairs = zip(Held.__annotations__, astuple(after), astuple(most), strict=True)
    return [f"{name}: {has}, at most {may}" for name, has, may in pairs if has > may]
