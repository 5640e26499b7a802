"""The memory contract: limits of queues and maps, and the memory limit that follows from them.

A daemon whose maps have at most P pixels, on a lattice of at most C cells, takes at most

    BASE_BYTES + MAPS * P + CELL_BYTES * C

and, if it plans lines over the floor, ``FLOOR_BYTES * P + STAND_BYTES * C`` more: its fine raster
has no more pixels than a map may have (``grid.fine_raster``). This applies to any input at any rate
and resolution. If ``MemoryMax=`` of the unit limits the memory, maps are limited so that the sum is
at most 90 % of it, above which the system throttles the service (``limited_to_memory``). Without
that limit, the configuration gives the largest map. One test checks the systemd units against these
constants, another measures memory.

A pixel is a byte, held in up to ten copies if updates are as large as the map:

* 3 in Zenoh: a message being assembled, one being handed over, one on its way to a recorder;
* 2 in the mailbox: the map queue and the update queue hold at most one largest message each;
* 3 in the cycle: a map and an update being decoded, and Zenoh's buffer of the last one;
* 2 in the mission: its map, and the map that it is compared with or patched to. A third copy, with
  obstacles, is part of the base, as it has at most 6 million pixels.

A keep-out mask is read while no map is decoded, and may take as much as two of the cycle's copies
(``mask_bytes``).

Larger messages are dropped on arrival. Nothing else grows with the pixels: kernels read a map tile
by tile, and tiles are bounded (``grid.lattice``).

A cell takes these bytes:

* the path: some 80 for each pose, twice while it is sent;
* the living trail: 16, another 16 while a plan or a writer has a copy (the trail of a plan's ants
  spans only the regions that they walked on), and 8 in the ledger's file;
* priorities: 1 if received as a message, and 2 for priorities of rooms;
* covered cells of the ledger: 4, with the copy being written;
* swept floor: 18 for a cell of 0.3 m (a bit for each pixel of 2.5 cm), and as much again if the
  floor has changed since the copy that is being written.

The ledger has limits of its own: 34 MB for cells, and twice 13 MB for floor.

Measured (``python -m tests.campaigns.memory``, x86-64): a mission on a map of a million pixels
takes 121 MB, 17 MB of them for the map, and 228 MB with pages of libraries, which the system can
reclaim (``fasaco-edge bench daemon``). A path of 440,000 cells takes 127 MB more; maps of 25
million pixels at 20 Hz take 75 MB more, 240 MB if an update of full size follows each, and another
50 MB with a recorder. The base includes 42 MB of samples other than maps that wait for the loop,
and the library pages in use. A library that was just unpacked takes up to 16 MB more pages than a
copy of it, as the system maps it in larger blocks.
"""

from __future__ import annotations

from msgspec import structs

from fasaco_edge.bus.access import HEADER_BYTES
from fasaco_edge.bus.mailbox import Queue
from fasaco_edge.config.config import DaemonConfig, MapConfig
from fasaco_edge.host.processes import MB
from fasaco_edge.wire.limits import MAX_BLOCKED_BYTES, MAX_POSE_BYTES, MAX_PRIORITY_BYTES
from fasaco_edge.wire.topics import QUEUE_LENGTHS

MIB = 1 << 20
# Interpreter, numpy, Zenoh, compiler, kernels, and the fixed part of a plan.
BASE_BYTES = 235 * MB
MAPS = 10
CELL_BYTES = 370
# Bytes of a pixel of floor, by its arrays: 3 for the floor to sweep and the line's passes over it,
# and 2 more while these move with a growing map. Blocked pixels and poses take a bit each; keep-out
# zones double these bits, and a new map triples them. A tenth more for the frame around the map.
FLOOR_BYTES = 7
# Pixels of the frame around any map, which is relatively widest around small maps.
FRAME_PIXELS = 100_000
# Bytes of a cell with stand and bends, by its arrays: 32, another 32 with keep-out zones, and again
# 32 while a new map comes in; and 26 for a point of the line.
STAND_BYTES = 128
# MemoryMax= relative to MemoryHigh=, above which the system only throttles a service.
SPARE = 1.1

# Number of copies of a pixel while a keep-out mask is read, memory of the reader of images, and
# least memory that a mask may use; a part of that is free in BASE_BYTES.
MASK_COPIES = 2
PILLOW_BYTES = 6 * MB
LEAST_MASK_BYTES = 14 * MB

# The smallest limits applied, enough for a small flat.
LEAST_PIXELS, LEAST_CELLS = 250_000, 10_000

# Queue limit of all kinds not listed in ``queues`` [bytes].
QUEUED_BYTES = 8 * MAX_POSE_BYTES


def map_bytes(max_pixels: int) -> int:
    """Return the largest size of a map or an update of ``max_pixels`` [bytes]."""
    return max_pixels + HEADER_BYTES


def most_bytes(kind: str, max_pixels: int) -> int:
    """Return the largest size of a sample of a kind [bytes]."""
    if kind in ("blocked", "priority"):
        return MAX_BLOCKED_BYTES if kind == "blocked" else MAX_PRIORITY_BYTES
    return map_bytes(max_pixels) if kind in ("map", "map_update") else MAX_POSE_BYTES


def queues(max_pixels: int) -> dict[str, Queue]:
    """Return the queue of each kind."""
    sizes = dict.fromkeys(("map", "map_update"), map_bytes(max_pixels))
    sizes["priority"] = MAX_PRIORITY_BYTES
    sizes["blocked"] = QUEUE_LENGTHS["blocked"] * MAX_BLOCKED_BYTES
    return {
        kind: Queue(length, sizes.get(kind, QUEUED_BYTES)) for kind, length in QUEUE_LENGTHS.items()
    }


def needed_bytes(config: DaemonConfig) -> int:
    """Return the largest memory of a daemon with this configuration [bytes]."""
    maps = config.map
    pixel_bytes, cell_bytes = unit_bytes(config)
    return BASE_BYTES + pixel_bytes * maps.max_pixels + cell_bytes * maps.max_lattice_cells


def has_default_sizes(config: DaemonConfig) -> bool:
    """Return whether the sizes of map and lattice are the defaults, which may be reduced."""
    maps, default = config.map, MapConfig()
    sizes = maps.max_pixels, maps.max_lattice_cells
    return sizes == (default.max_pixels, default.max_lattice_cells)


def unit_bytes(config: DaemonConfig) -> tuple[int, int]:
    """Return the memory of a pixel and of a cell [bytes]."""
    if config.planner.line == "cells":
        return MAPS, CELL_BYTES
    return MAPS + FLOOR_BYTES, CELL_BYTES + STAND_BYTES


def floor_pixels(max_pixels: int) -> int:
    """Return the limit on the pixels of the raster of floor, for maps of ``max_pixels``.

    The raster adds a frame around the map, so that every accepted map fits.
    """
    return max_pixels + max_pixels // 10 + FRAME_PIXELS


def mask_bytes(config: DaemonConfig, limit: int | None) -> int:
    """Return the memory for reading a keep-out mask under a memory limit [bytes].

    A mask may take the memory for decoding a map and an update, as none is decoded while the
    configuration is reloaded. A small picture is always read.
    """
    share = MASK_COPIES * limited_to_memory(config, limit).map.max_pixels
    return max(share - PILLOW_BYTES, LEAST_MASK_BYTES)


def limits_mib(config: DaemonConfig) -> tuple[int, int]:
    """Return the values for ``MemoryHigh=`` and ``MemoryMax=`` of the daemon's unit [MiB].

    Both are rounded up to multiples of 16.
    """
    needed = needed_bytes(config) / MIB
    high, most = (-(-int(mib + 1) // 16) * 16 for mib in (needed, SPARE * needed))
    return high, most


def limited_to_memory(config: DaemonConfig, limit: int | None) -> DaemonConfig:
    """Return the configuration with map and lattice sizes limited to fit ``limit`` [bytes].

    None is no limit. Both shrink by the same factor, but not below the size of a small flat.
    """
    if limit is None or needed_bytes(config) <= (high := int(limit / SPARE)):
        return config
    maps, spare = config.map, high - BASE_BYTES
    least_pixels = min(LEAST_PIXELS, maps.max_pixels)
    least_cells = min(LEAST_CELLS, maps.max_lattice_cells)
    pixel_bytes, cell_bytes = unit_bytes(config)
    share = max(spare, 0) / (needed_bytes(config) - BASE_BYTES)
    cells = max(int(share * maps.max_lattice_cells), least_cells)
    pixels = max(min((spare - cell_bytes * cells) // pixel_bytes, maps.max_pixels), least_pixels)
    # Pixels at their least number leave less memory for cells.
    cells = max(min((spare - pixel_bytes * pixels) // cell_bytes, cells), least_cells)
    smaller = structs.replace(maps, max_pixels=pixels, max_lattice_cells=cells)
    return structs.replace(config, map=smaller)
