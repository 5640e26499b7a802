"""Maps of every size, resolution and rate for a daemon with limited memory.

    python -m tests.campaigns.memory
    python -m tests.campaigns.memory --sides 1000,5000,8000 --rates 20 --limit-mb 400
    python -m tests.campaigns.memory --kinds grey,colour --rates 20

Takes half an hour.

The daemon runs in a control group with its unit's MemoryMax=, where there is one to be had. It is
to live, whatever comes: what it takes must fit into what ``fasaco_edge.daemon.memory`` says, what
it does not take it must refuse with an error that names the number.
"""

from __future__ import annotations

import argparse
import re
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import isqrt
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.bench.processes import warm_kernels
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import load_config
from fasaco_edge.daemon.memory import limited_to_memory, needed_bytes
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.host.processes import peak_mb
from fasaco_edge.wire.messages.maps import encode_map_update, encode_occupancy_grid
from fasaco_edge.wire.schemas import OCCUPANCY_GRID
from tests.support import processes
from tests.support.outsider import Outsider, open_client
from tests.support.processes import Daemon, daemon_process
from tests.support.rooms import map_bytes, pose_bytes, room
from tests.support.service_manager import Group, Manager, memory_group, unit_limit, why_not

SIDES = (1000, 2000, 2300, 5000, 8000)
RESOLUTIONS = (0.0001, 0.02, 0.05)
RATES = (1.0, 10.0, 20.0)
KINDS = ("maps", "moving", "updates", "mappers", "grey", "colour", "message")
# Keep-out masks of that side, read by a daemon whose maps are as large as they may be.
MASKS = {"grey": "L", "colour": "RGBA"}
# What a daemon's log says of a mask that it does not take.
REFUSED = re.compile(r"(?:configuration|keep-out mask) refused(.*)")
# Mappers that speak at once.
MAPPERS = 3
# A daemon is asked for its status so often before it counts as stuck.
ANSWERS_S = 180.0


@dataclass(frozen=True)
class Flood:
    """What is sent to one daemon.

    Attributes:
        kind: "maps" that differ in a pixel; "moving" ones, none on the raster of the one before;
            "updates": each map followed by an update of all of it; "mappers": several at once;
            one of ``MASKS``: updates, and a keep-out mask in between; "message": one that comes
            as a message.
        side: of the square maps, or the mask [pixels].
        resolution: edge of a pixel [m].
        rate: so many a second, if the link takes them.
    """

    kind: str
    side: int
    resolution: float
    rate: float


@dataclass
class Row:
    """What came of a flood.

    Attributes:
        outcome: "taken", "refused" or "ended".
        error: what the daemon said last of what it refused.
        sent, taken: maps.
        peak_mb: the most the daemon was resident with.
        needs_mb: the most it may be, by its configuration and limit.
        broken: what it must not do, and did; "" for nothing.
    """

    kind: str
    side: int
    resolution: float
    rate: float
    outcome: str
    sent: int
    taken: int
    peak_mb: float
    needs_mb: float
    error: str
    broken: str


def map_payload(flood: Flood, number: int) -> bytes:
    """Return a hall; ``number`` distinguishes it from others."""
    pixels = np.zeros((flood.side, flood.side), np.int8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 100
    pixels[flood.side // 2, flood.side // 2 + 8 * number] = 100
    x = 0.3 * flood.resolution * number if flood.kind == "moving" else 0.0
    geometry = GridGeometry(flood.side, flood.side, flood.resolution, Pose2D(x, 0.0))
    return encode_occupancy_grid(OccupancyGrid(geometry, pixels, "map", number))


def update_payload(flood: Flood) -> bytes:
    """Return an update of all of it."""
    pixels = np.full((flood.side, flood.side), 0, np.int8)
    return encode_map_update(MapPatch(Window(0, 0, flood.side, flood.side), pixels, "map", 9))


def mask_pixels(side: int, free: int, kept_out: int) -> NDArray[np.uint8]:
    """Return the pixels of a mask that keeps out of two rectangles."""
    pixels = np.full((side, side), free, np.uint8)
    pixels[: side // 3, 1 : side // 9] = pixels[-side // 7 :] = kept_out
    return pixels


def put_mask(outsider: Outsider, side: int) -> None:
    """Publish a mask as a message."""
    geometry = GridGeometry(side, side, 0.05, Pose2D(500.0, 500.0))
    pixels = mask_pixels(side, 0, 100).view(np.int8)
    payload = encode_occupancy_grid(OccupancyGrid(geometry, pixels, "map", 1))
    outsider.put("keep_out_mask", payload, OCCUPANCY_GRID)


def mask_file(flood: Flood, folder: Path) -> Path:
    """Write a mask; return the map_server YAML file."""
    pixels = mask_pixels(flood.side, 255, 0)
    Image.fromarray(pixels).convert(MASKS[flood.kind]).save(folder / "mask.png")
    keys = {"image": "mask.png", "resolution": 0.05, "origin": [500.0, 500.0, 0.0], "negate": 0}
    file = folder / "mask.yaml"
    file.write_text(yaml.safe_dump(keys))
    return file


def pour_with_mask(
    flood: Flood,
    config: Path,
    daemon: Daemon,
    outsider: Outsider,
    seconds: float,
    limit: int | None,
) -> bool:
    """Send the largest maps, and let a mask be read meanwhile; return whether it was taken."""
    if flood.kind == "message":
        reload = threading.Timer(seconds / 2, put_mask, [outsider, flood.side])
    else:
        document = yaml.safe_load(config.read_text())
        document["mission"]["keep_out_mask"] = str(mask_file(flood, config.parent))
        config.write_text(yaml.safe_dump(document))
        reload = threading.Timer(seconds / 2, daemon.process.send_signal, [signal.SIGHUP])
    largest = isqrt(limited_to_memory(load_config(config), limit).map.max_pixels)
    reload.start()
    pour(replace(flood, kind="updates", side=largest), daemon, outsider, seconds)
    reload.join()
    until = time.monotonic() + ANSWERS_S
    while time.monotonic() < until and daemon.process.poll() is None:
        # Not by the log, which holds back a second line of a kind.
        mask = outsider.ask("@rpc/config").json()["mission"]["keep_out_mask"]
        if f"[{flood.side},{flood.side}," in mask:
            return True
        if REFUSED.search(daemon.log_text()):
            return False
        time.sleep(0.5)
    return False


def pour(flood: Flood, daemon: Daemon, outsider: Outsider, seconds: float) -> int:
    """Send for so long; return how many maps that were."""
    payloads = [map_payload(flood, number) for number in range(3)]
    update = update_payload(flood) if flood.kind == "updates" else b""
    sent, ends = 0, time.monotonic() + seconds
    with ExitStack() as stack:
        sessions = [outsider.session]
        for _ in range(MAPPERS - 1 if flood.kind == "mappers" else 0):
            session = open_client(daemon.endpoint)
            stack.callback(session.close)
            sessions.append(session)
        while time.monotonic() < ends and daemon.process.poll() is None:
            due = time.monotonic() + 1.0 / flood.rate
            outsider.session, own = sessions[sent % len(sessions)], outsider.session
            outsider.put("map", payloads[sent % 3])
            if update:
                outsider.put("map_update", update)
            outsider.session = own
            sent += 1
            time.sleep(max(due - time.monotonic(), 0.0))
    return sent


def settled(
    outsider: Outsider, daemon: Daemon, earlier: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return the status once the daemon has nothing to do any more.

    Args:
        outsider, daemon: whom to ask, and about whom.
        earlier: the status before something was sent, which it has to report.
    """
    until, before = time.monotonic() + ANSWERS_S, ()
    known = earlier and (_maps(earlier), earlier["errors"]["total"])
    while daemon.process.poll() is None:
        status = outsider.ask_status()
        now = (_maps(status), status["errors"]["total"], status["plan"]["planning"])
        is_settled = now == before and not now[2] and now[:2] != known
        if is_settled or time.monotonic() > until:
            return status
        before = now
        time.sleep(1.2)
    return {}


def _maps(status: dict[str, Any]) -> int:
    """Return how many maps a mission has had; one that has just begun again has none."""
    return status["map"]["revision"] if status["map"] else 0


def run_flood(
    flood: Flood,
    folder: Path,
    seconds: float,
    group: Group | None,
    limit: int | None,
    **config: Any,
) -> Row:
    """Run a daemon on a small map, pour, and see what has become of it."""
    program = (*group.program, *PROGRAM) if group else PROGRAM
    # Other tests count cells; what the unit has room for is the default.
    config = {"planner": {"line": DaemonConfig().planner.line}} | config
    if flood.kind == "message":
        config["mission"] = config.get("mission", {}) | {"keep_out_topic": True}
    processes.PROGRAM = program
    manager = Manager(folder)
    told = {"NOTIFY_SOCKET": manager.address}
    try:
        with (
            daemon_process(folder, env=told, executed=True, **config) as daemon,
            Outsider(daemon.endpoint) as outsider,
        ):
            file = next(folder.glob("daemon*.yaml"))
            written, has_mask = load_config(file), None
            needs = needed_bytes(limited_to_memory(written, limit))
            outsider.put("map", map_bytes(room(8.0, 6.0)))
            outsider.put("pose", pose_bytes(0.75, 0.75))
            if flood.kind == "message":
                put_mask(outsider, 8)
            outsider.wait_status(lambda status: status["state"] == "covering")
            before = settled(outsider, daemon)
            if flood.kind in (*MASKS, "message"):
                sent = 1
                has_mask = pour_with_mask(flood, file, daemon, outsider, seconds, limit)
            else:
                sent = pour(flood, daemon, outsider, seconds)
            status = settled(outsider, daemon, before)
            peak = peak_mb(daemon.pid) if status else 0.0
    finally:
        processes.PROGRAM = PROGRAM
        manager.close()
    row = Row(
        **asdict(flood), outcome="ended", sent=sent, taken=0, peak_mb=peak,
        needs_mb=round(needs / 1e6), error="", broken="the daemon has ended",
    )  # fmt: skip
    if status:
        row.taken = _maps(status) - _maps(before)
        row.error = status["errors"]["last"]
        if has_mask is not None:
            row.taken = has_mask
            why = REFUSED.search(daemon.log_text())
            row.error = why[1] if why and not has_mask else ""
        row.outcome, row.broken = "taken" if row.taken else "refused", ""
        # Updates of a map that was refused are refused in their turn, for want of it.
        refusal = "map_too_large" if has_mask is None else "bad_configuration"
        if not row.taken and not status["errors"]["by_code"].get(refusal):
            row.broken = "neither taken nor refused"
        elif peak > row.needs_mb:
            row.broken = f"{peak:.0f} MB are more than it says"
    return row


PROGRAM = processes.PROGRAM


def run_floods(
    floods: Iterable[Flood], folder: Path, seconds: float, limit: int, **config: Any
) -> Iterator[Row]:
    """Yield what comes of each flood, each on a daemon of its own."""
    reason = why_not()
    for number, flood in enumerate(floods):
        place = folder / str(number)
        place.mkdir()
        if reason:
            yield run_flood(flood, place, seconds, None, None, **config)
            continue
        with memory_group(limit) as group:
            row = run_flood(flood, place, seconds, group, limit, **config)
            if group.kills:
                row.broken = f"killed at {limit >> 20} MiB"
            yield row


def line(row: Row) -> str:
    """Return a row of the table."""
    said = row.broken.upper() or (row.error if row.outcome == "refused" else "")
    return (
        f"{row.kind:8} {row.side:5} {row.resolution:7g} {row.rate:5g}  {row.outcome:8}"
        f"{row.sent:5} {row.taken:6} {row.peak_mb:7.0f} {row.needs_mb:7.0f}  {said[:70]}"
    )


HEADER = "kind      side  m/pixel   Hz  outcome   sent  taken    peak   needs  [MB]"


def _numbers(kind: type) -> Any:
    return lambda text: tuple(kind(word) for word in text.split(","))


def main() -> None:
    """Run the campaign; exit code 1 if the daemon broke its word."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sides", type=_numbers(int), default=SIDES, help="of the maps [pixels]")
    parser.add_argument("--resolutions", type=_numbers(float), default=RESOLUTIONS, help="[m]")
    parser.add_argument("--rates", type=_numbers(float), default=RATES, help="[Hz]")
    parser.add_argument("--kinds", type=_numbers(str), default=KINDS, help=", ".join(KINDS))
    parser.add_argument("--seconds", type=float, default=5.0, help="each flood takes")
    parser.add_argument("--limit-mb", type=int, help="by default the unit's MemoryMax= [MiB]")
    args = parser.parse_args()
    limit = args.limit_mb << 20 if args.limit_mb else unit_limit()
    warm_kernels()
    print(
        why_not() or f"limit {limit >> 20} MiB",
        f"default needs {needed_bytes(DaemonConfig()) / 1e6:.0f} MB",
    )
    print(HEADER)
    floods = [
        Flood(*words) for words in product(args.kinds, args.sides, args.resolutions, args.rates)
    ]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for row in run_floods(floods, Path(folder), args.seconds, limit):
            rows.append(row)
            print(line(row), flush=True)
    broken = sum(bool(row.broken) for row in rows)
    print(
        f"{len(rows)} floods, {broken} broken promises, most {max(r.peak_mb for r in rows):.0f} MB"
    )
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
