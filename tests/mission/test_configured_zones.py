"""Zones of the configuration: orders name them, and every mission keeps out."""

import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.mission.core.look_around import LOOK_S
from fasaco_edge.mission.events import MapReceived, State
from fasaco_edge.mission.map.frame_selector import PATIENCE_S
from fasaco_edge.mission.orders.mask import inline_grid, inline_mask, mask_polygons
from fasaco_edge.mission.orders.order import ConfiguredZone, read_order
from fasaco_edge.mission.orders.zones import with_kept_out
from tests.mission.world import (
    CELL,
    CONFIG,
    PIXELS,
    building,
    cells,
    idle,
    pose_at,
    rectangle,
    robot_in,
    with_policy,
)

ROOM = (".........",) * 6
KITCHEN = ConfiguredZone(name="kitchen", polygon=[tuple(at) for at in rectangle(0, 6, 3, 9)])
COLUMN = tuple(tuple(at) for at in rectangle(2, 2, 4, 4))


def drive_with(**policy):
    return idle(*ROOM, config=with_policy(CONFIG, **policy))


def mask_file(folder, marked, resolution=CELL / PIXELS, origin=(0.0, 0.0, 0.0)):
    """A map_server mask; ``marked`` are pixels from the smallest y up."""
    Image.fromarray(np.where(marked[::-1], 0, 255).astype(np.uint8)).save(folder / "mask.png")
    file = folder / "mask.yaml"
    file.write_text(
        f"image: mask.png\nresolution: {resolution}\norigin: {list(origin)}\nmode: scale\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return file


def test_an_order_covers_a_zone_by_its_name():
    drive = drive_with(zones=(KITCHEN,))
    drive.command("start", {"zones": [{"name": "kitchen"}]})
    drive.finish()
    kept = drive.mission.order_state.order
    by_corners = read_order({"zones": [{"name": "kitchen", "polygon": KITCHEN.polygon}]})
    assert kept == by_corners
    assert cells(0, 6, 3, 9) <= drive.visited


def test_configured_keep_out_zones_apply_to_each_order():
    drive = drive_with(keep_out=(COLUMN,))
    drive.command("start")
    drive.finish()
    # The disc touches the zone in the cells around it as well.
    assert not set(drive.driven) & cells(2, 2, 4, 4)
    first = set(drive.driven)
    other = [list(at) for at in rectangle(0, 5, 1, 6)]
    drive.command("start", {"keep_out": [other]})
    drive.finish()
    again = set(drive.driven) - first
    assert not again & (cells(2, 2, 4, 4) | cells(0, 5, 1, 6))


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_mask_keeps_out_of_the_pixels_that_it_shows(tmp_path, yaw):
    marked = np.random.default_rng(5).random((23, 31)) < 0.4
    file = mask_file(tmp_path, marked, 0.125, (-0.5, 0.25, yaw))
    polygons = mask_polygons(inline_mask(file, 65))
    # Each pixel's centre is in one of them just where it is marked.
    grid = building(*("." * 40,) * 40, at=(-8, -8))
    kept_out = with_kept_out(grid, polygons).cells == 100
    cos, sin = np.cos(yaw), np.sin(yaw)
    for row, col in np.ndindex(*grid.cells.shape):
        x, y = grid.geometry.to_map(col + 0.5, row + 0.5)
        u, v = x + 0.5, y - 0.25
        at = (cos * v - sin * u) / 0.125, (cos * u + sin * v) / 0.125
        if min(abs(value - round(value)) for value in at) < 1e-6:
            continue  # on the border between two
        at_row, at_col = int(np.floor(at[0])), int(np.floor(at[1]))
        inside = 0 <= at_row < 23 and 0 <= at_col < 31 and marked[at_row, at_col]
        assert kept_out[row, col] == inside


def test_a_mission_with_a_mask_drives_as_with_the_polygon(tmp_path):
    marked = np.zeros((12, 18), bool)
    marked[4:8, 4:8] = True
    mask = inline_mask(mask_file(tmp_path, marked), 65)
    assert len(mask_polygons(mask)) == 1
    walks = []
    for policy in ({"keep_out_mask": mask}, {"keep_out": (COLUMN,)}):
        drive = drive_with(**policy)
        drive.command("start")
        drive.finish()
        walks.append(drive.driven)
    assert walks[0] == walks[1]


@pytest.mark.parametrize("lattice_deg", [0.0, 30.0])
def test_a_mask_of_another_frame_than_the_maps_stops_the_robot(lattice_deg):
    """In coordinates of another map it would keep out of other places, and not of its own."""
    mask = inline_grid(building("##", at=(2, 2)), 65)
    config = replace(with_policy(CONFIG, keep_out_mask=mask), lattice_deg=lattice_deg)
    drive = robot_in(*ROOM, config=config)
    # Askew, the room has few cells and unseen floor beside them: first the robot looks around.
    for seconds in (LOOK_S + 1.0, 2.0):
        drive.tell(after=seconds)
    drive.plan()
    assert drive.mission.state is State.COVERING
    drive.tell(MapReceived(building(*ROOM, frame="odom")))
    for _ in range(int(PATIENCE_S) + 2):
        decision = drive.tell(pose_at(0, 0, frame="odom"), after=1.0)
        assert drive.mission.grid.frame == "map" or drive.walk == []
    assert (drive.mission.grid.frame, decision.plan) == ("odom", None)
    why = "the keep-out mask is in frame 'map', the map in 'odom': waits for a mask in 'odom'"
    assert (drive.mission.state, drive.mission.reason) == (State.BLOCKED, why)
    drive.command("home")
    assert (drive.mission.state, drive.walk) == (State.BLOCKED, [])
    # The frame of the mask again.
    drive.command("start")
    for _ in range(int(PATIENCE_S) + 2):
        drive.tell(MapReceived(building(*ROOM)), pose_at(0, 0), after=1.0)
    drive.plan()
    assert drive.mission.state is State.COVERING


def test_invalid_masks_are_refused(tmp_path):
    with pytest.raises(BadConfiguration, match=r"mission\.keep_out_mask: .*mask\.yaml"):
        inline_mask(tmp_path / "mask.yaml", 65)
    stripes = np.indices((64, 200)).sum(axis=0) % 2 == 0
    with pytest.raises(BadConfiguration, match="take more than 2000 rectangles"):
        inline_mask(mask_file(tmp_path, stripes), 65)
    for wrong in ("mask:", "mask:{}", 'mask:{"geometry":[9,9,1,0,0,0],"deflated":"!"}'):
        with pytest.raises(BadConfiguration, match="not a mask"):
            mask_polygons(wrong)


def test_a_picture_that_is_no_mask_is_refused_without_delay(tmp_path):
    noise = np.indices((1500, 1500)).sum(axis=0) % 2 == 0
    began = time.process_time()
    with pytest.raises(BadConfiguration, match="take more than 2000 rectangles"):
        inline_mask(mask_file(tmp_path, noise), 65)
    assert time.process_time() - began < 5.0


def test_a_mask_takes_no_more_memory_than_it_may(tmp_path):
    """One of 64 million pixels took a gigabyte, in a daemon of a limited one."""
    marked = np.zeros((1500, 2000), bool)
    marked[:700, 400:900] = marked[900:905] = True
    file = mask_file(tmp_path, marked)
    assert len(mask_polygons(inline_mask(file, 65, 11_000_000))) == 2
    for image, mode, takes in (("mask.png", "RGBA", "19.9"), ("mask.jpg", "RGB", "37.9")):
        picture = Image.open(tmp_path / "mask.png").convert(mode)
        picture.save(tmp_path / image, progressive=True)
        file.write_text(file.read_text().replace("mask.png", image))
        with pytest.raises(BadConfiguration, match=rf"{takes} MB to read, more than the 11\.0"):
            inline_mask(file, 65, 11_000_000)
        file.write_text(file.read_text().replace(image, "mask.png"))


def test_a_mask_of_one_row_takes_no_more_either(tmp_path):
    """Each pixel of it was a rectangle at first."""
    for cols, said in ((90_000, "take more than 2000 rect"), (4_000_000, "4000000 pixels wide")):
        stripes = np.indices((1, cols)).sum(axis=0) % 2 == 0
        tracemalloc.start()
        with pytest.raises(BadConfiguration, match=said):
            inline_mask(mask_file(tmp_path, stripes), 65, 99_000_000_000)
        assert tracemalloc.get_traced_memory()[1] < 100_000_000
        tracemalloc.stop()


def test_a_mask_that_takes_long_to_read_is_refused(tmp_path):
    """A daemon reads it between two turns of its loop."""
    file = mask_file(tmp_path, np.zeros((1, 1), bool))
    (tmp_path / "mask.png").write_bytes(b"P5 1100 1000 100\n" + bytes(1_100_000))
    with pytest.raises(BadConfiguration, match="slow to read; the limit is 1000000 pixels"):
        inline_mask(file, 65, 44_000_000)
