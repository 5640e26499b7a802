"""Hints: each says what to do about the fault that was met, not about its class."""

import traceback

import numpy as np
import pytest
import yaml
from PIL import Image

from fasaco_edge.errors import FasacoError, MapFileError, NothingToCover
from fasaco_edge.grid.map_files import find_map, read_coverage_grid, read_map
from fasaco_edge.mission.orders.order import Command
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.offline.maps import load_map
from fasaco_edge.offline.plan import plan
from fasaco_edge.wire import schemas
from fasaco_edge.wire.documents.json_text import decode_json
from fasaco_edge.wire.messages.battery import decode_battery
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from fasaco_edge.wire.messages.poses import decode_pose
from tests.wire.contract_files import PROTOCOL

BLACK, GREY, WHITE = 0, 205, 254
DESCRIPTION = {
    "image": "map.png",
    "resolution": 0.05,
    "origin": [0.0, 0.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def described(folder, pixels, **changes):
    Image.fromarray(np.array(pixels, np.uint8)).save(folder / "map.png")
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump(DESCRIPTION | changes))
    return path


def hint_of(act, *given, kind=FasacoError, **named):
    with pytest.raises(kind) as caught:
        act(*given, **named)
    # In a notebook the traceback alone shows it.
    assert traceback.format_exception_only(caught.value)[-1] == f"hint: {caught.value.hint}\n"
    return caught.value.hint


@pytest.mark.parametrize(
    ("changes", "hint"),
    [
        ({"image": "none.png"}, "image is a path from this file's folder"),
        ({"resolution": "five"}, "resolution is the edge of a pixel"),
        ({"resolution": 500}, "the edge of a pixel in metres"),
        ({"free_thresh": 0.9}, "map_saver writes free_thresh"),
        ({"mode": "grey"}, "mode is trinary"),
        ({"origin": [0, 0]}, "origin is [x, y, yaw]"),
    ],
)
def test_a_fault_inside_a_map_file_is_corrected_there(tmp_path, changes, hint):
    assert hint in hint_of(read_map, described(tmp_path, [[WHITE]], **changes), kind=MapFileError)


def test_faults_of_a_file_and_of_its_name_have_other_hints(tmp_path):
    names = MapFileError.hint
    (tmp_path / "list.yaml").write_text("- 1\n")
    (tmp_path / "torn.png").write_bytes(b"P5 3 3 255 \x00")
    np.save(tmp_path / "ints.npy", np.ones((2, 2), int))
    torn = described(tmp_path, [[WHITE]], image="torn.png")
    assert hint_of(find_map, "nowhere") == names
    assert "map_server YAML" in hint_of(read_map, tmp_path / "list.yaml")
    assert "exists" in hint_of(read_map, tmp_path / "none.yaml")
    assert "whole" in hint_of(read_map, torn)
    assert "True = coverable" in hint_of(read_coverage_grid, tmp_path / "ints.npy")
    assert "True = coverable" in hint_of(load_map, np.ones((2, 2), int))


def test_a_traceback_shows_the_hint():
    with pytest.raises(MapFileError) as caught:
        load_map("ofice")
    assert "\nhint: did you mean office?" in "".join(traceback.format_exception(caught.value))


def test_the_image_of_a_map_may_be_in_a_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "elsewhere").mkdir()
    path = described(tmp_path, [[WHITE, WHITE]], image="~/map.png")
    moved = path.rename(tmp_path / "elsewhere" / "map.yaml")
    assert read_map(moved).cells.shape == (1, 2)


@pytest.mark.parametrize(
    ("pixels", "said", "hint"),
    [
        (np.full((40, 40), BLACK), "no pixel of the map is free", "negate, mode and free_thresh"),
        (np.full((40, 40), GREY), "100 % are unknown", "--unknown-free"),
        (np.where(np.arange(40) == 20, WHITE, BLACK)[None].repeat(40, 0), "2.5 % of", "radius"),
    ],
)
def test_a_map_without_free_floor_differs_from_a_wide_robot(tmp_path, pixels, said, hint):
    map_ = load_map(described(tmp_path, pixels))
    with pytest.raises(NothingToCover, match=said) as caught:
        plan(map_)
    assert hint in caught.value.hint


def test_a_grid_without_free_cells_has_no_robot_to_check():
    assert "True" in hint_of(plan, load_map(np.zeros((3, 3), bool)), kind=NothingToCover)


def vector(name):
    return (PROTOCOL / "vectors" / "hostile" / f"{name}.bin").read_bytes()


@pytest.mark.parametrize(
    ("decode", "name", "hint"),
    [
        (decode_battery, "battery_in_percent", "0 to 1: divide a driver's percentage by 100"),
        (decode_occupancy_grid, "grid_resolution_kilometre", "in metres"),
        (decode_occupancy_grid, "grid_origin_far", "in metres"),
        (decode_occupancy_grid, "grid_origin_no_turn", "quaternion"),
        (decode_occupancy_grid, "grid_value_101", "correct this field"),
        (decode_occupancy_grid, "big_endian", "message type and encoding"),
        (decode_battery, "battery_trailing", "message type and encoding"),
    ],
)
def test_a_wrong_value_differs_from_a_wrong_type(decode, name, hint):
    assert hint in hint_of(decode, vector(name))


def test_unknown_types_and_broken_messages_have_other_hints():
    assert "name it in the encoding" in hint_of(decode_pose, b"", "std_msgs/String")
    assert "type and encoding" in hint_of(decode_pose, b"", schemas.POSE_STAMPED)


def test_a_fault_in_json_is_no_fault_of_cdr():
    for payload in (b"{", b'{"a": 1e999}', b"[]", b'{"a": %d}' % 10**30):
        assert "protocol/schema" in hint_of(decode_json, payload)


def test_a_command_that_is_refused_says_what_comes_first():
    paused = OrderState.autostart().commanded(Command("pause"), has_home=False)
    assert "resume the mission" in hint_of(paused.commanded, Command("replan"), has_home=False)
    idle = OrderState.idle("why")
    assert "start the mission" in hint_of(idle.commanded, Command("replan"), has_home=False)
