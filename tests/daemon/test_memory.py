"""The memory contract: one formula, and everything that names a number of it says the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec import structs

from fasaco_edge.config.config import DaemonConfig, MapConfig, PlannerConfig
from fasaco_edge.daemon.memory import (
    BASE_BYTES,
    FLOOR_BYTES,
    FRAME_PIXELS,
    LEAST_CELLS,
    LEAST_MASK_BYTES,
    LEAST_PIXELS,
    MASK_COPIES,
    MIB,
    PILLOW_BYTES,
    SPARE,
    floor_pixels,
    limited_to_memory,
    limits_mib,
    mask_bytes,
    most_bytes,
    needed_bytes,
    queues,
    unit_bytes,
)
from fasaco_edge.grid.fine_raster import RobotDiscs, fine_geometry
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import MOST_REACH_PX
from fasaco_edge.wire.limits import MAX_GRID_CELLS, MAX_POSE_BYTES
from fasaco_edge.wire.topics import QUEUE_LENGTHS
from tests.support.service_manager import unit_limit
from tests.wire.contract_files import CONTRACT

ROOT = Path(__file__).parents[2]
DEFAULT = DaemonConfig()
LARGE_MAPS = ROOT / "deploy" / "drop-ins" / "large-maps.conf"
CELLS = DaemonConfig(planner=PlannerConfig(line="cells"))


def test_the_drop_in_for_large_maps_allows_the_memory_needed():
    high, most = limits_mib(DEFAULT)
    unit = LARGE_MAPS
    assert (unit_limit("MemoryHigh", unit), unit_limit("MemoryMax", unit)) == (
        high * MIB,
        most * MIB,
    )
    assert needed_bytes(DEFAULT) <= high * MIB < most * MIB
    assert limited_to_memory(DEFAULT, most * MIB) == DEFAULT


def test_the_units_limit_allows_maps_as_large_as_documented():
    smaller = limited_to_memory(DEFAULT, unit_limit())
    assert needed_bytes(smaller) <= unit_limit("MemoryHigh") * 1.02 < unit_limit()
    pixels, cells = smaller.map.max_pixels // 100_000 / 10, smaller.map.max_lattice_cells // 1000
    guide = " ".join((ROOT / "deploy" / "README.md").read_text().split())
    assert f"up to {pixels} million pixels" in guide
    assert f"up to {cells},000 cells" in guide
    assert f"MemoryMax={unit_limit() // MIB}M" in guide
    contract = " ".join(CONTRACT.split())
    assert f"{pixels} million pixels and {cells},000 cells" in contract


def test_the_guides_say_the_formula():
    guide = " ".join((ROOT / "deploy" / "README.md").read_text().split())
    for config in (DEFAULT, CELLS):
        pixel, cell = unit_bytes(config)
        formula = f"{BASE_BYTES:,} + {pixel} x map.max_pixels + {cell} x map.max_lattice_cells"
        assert formula in guide
    assert f"MemoryMax={limits_mib(DEFAULT)[1]}M" in guide
    reads = f"{MASK_COPIES} x map.max_pixels - {PILLOW_BYTES:,}"
    assert f"{reads} bytes ({mask_bytes(DEFAULT, None) // 1_000_000} MB)" in guide
    contract = " ".join(CONTRACT.split())
    maps = DEFAULT.map
    assert f"`map.max_pixels` pixels ({maps.max_pixels:,}" in contract
    assert f"`map.max_lattice_cells` cells ({maps.max_lattice_cells:,})" in contract
    assert f"no more than {needed_bytes(DEFAULT) / 1e6:.0f} MB" in contract
    assert f"more than {MOST_REACH_PX} of them" in contract
    limits = (ROOT / "protocol" / "limits.yaml").read_text()
    assert f"by default {maps.max_pixels}" in limits


@given(st.integers(0, 4 << 30))
def test_a_mask_is_read_in_what_maps_leave(limit):
    """While the configuration is read again no map and no update are decoded."""
    most = mask_bytes(DEFAULT, limit)
    assert most + PILLOW_BYTES <= 2 * limited_to_memory(DEFAULT, limit).map.max_pixels or (
        most == LEAST_MASK_BYTES < BASE_BYTES / 10
    )
    assert most <= mask_bytes(DEFAULT, None)


@given(st.integers(1, MAX_GRID_CELLS))
def test_queued_messages_are_part_of_the_estimate(max_pixels):
    rooms = queues(max_pixels)
    waiting = sum(max(rooms[kind].size, most_bytes(kind, max_pixels)) for kind in QUEUE_LENGTHS)
    # The other shares of a pixel are for the turn and for Zenoh.
    assert waiting <= BASE_BYTES / 3 + 2 * max_pixels
    assert most_bytes("pose", max_pixels) == MAX_POSE_BYTES


@given(st.integers(0, 4 << 30), st.integers(1, MAX_GRID_CELLS), st.integers(1, 4_000_000))
@example(limit=150_000_515, pixels=1, cells=1)  # more than is throttled, and nothing to shrink
@example(limit=324_169_522, pixels=9, cells=379_721)  # where only the cells can shrink
def test_under_any_limit_no_more_is_taken_than_it_affords(limit, pixels, cells):
    maps = MapConfig(max_pixels=pixels, max_lattice_cells=cells)
    config = structs.replace(DEFAULT, map=maps)
    smaller = limited_to_memory(config, limit)
    pixel, cell = unit_bytes(config)
    least = BASE_BYTES + pixel * LEAST_PIXELS + cell * LEAST_CELLS
    assert needed_bytes(smaller) <= max(limit, least)
    assert smaller.map.max_pixels <= pixels
    assert smaller.map.max_lattice_cells <= cells
    if needed_bytes(config) <= int(limit / SPARE):
        assert smaller is config
    assert limited_to_memory(config, None) is config


@pytest.mark.parametrize("side", [500, 2000, 5000])
@pytest.mark.parametrize("resolution_m", [0.02, 0.03, 0.05])
def test_a_map_that_is_taken_has_room_for_its_floor(side, resolution_m):
    """The frame around it is no reason to refuse it."""
    coarse = GridGeometry(side, side, resolution_m, Pose2D(0.0, 0.0))
    robot = DEFAULT.robot
    discs = RobotDiscs(robot.radius_m, robot.tool_width_m)
    fine, parts = fine_geometry(coarse, discs, floor_pixels(side * side))
    assert parts == 1
    assert fine.rows * fine.cols * 6 <= side * side * FLOOR_BYTES + 6 * FRAME_PIXELS
