"""Places of configuration and orders: used on the map that they were given for, and on no other."""

from dataclasses import replace

import pytest

from fasaco_edge.errors import PlacesElsewhere
from fasaco_edge.mission.config import BatteryPolicy, Dock, Place
from fasaco_edge.mission.events import BatteryReceived, MapReceived, State
from fasaco_edge.mission.orders.mask import inline_grid
from fasaco_edge.mission.orders.order import ConfiguredZone
from fasaco_edge.mission.work.order_state import OrderState
from tests.mission.test_other_building import FLOOR, OTHER
from tests.mission.world import CONFIG, Drive, building, pose_at, rectangle, with_policy

HERE = (1, 1)
KEEP_OUT = (tuple(map(tuple, rectangle(3, 3, 5, 5))),)
ZONES = (ConfiguredZone(name="kitchen", polygon=tuple(map(tuple, rectangle(1, 1, 4, 4)))),)
HOME = Place(x_m=2.1, y_m=1.1)
WITH_ALL = with_policy(CONFIG, keep_out=KEEP_OUT, zones=ZONES, home=HOME)
WITHOUT_KEEP_OUT = with_policy(CONFIG, zones=ZONES, home=HOME)


def floor(frame, rows=FLOOR):
    return MapReceived(building(*rows, frame=frame)), pose_at(*HERE, frame=frame)


def stand(drive, frame, seconds, rows=FLOOR):
    """Stand on a floor; return all faults."""
    faults = []
    for _ in range(round(seconds)):
        faults += drive.tell(*floor(frame, rows), after=0.5).faults
        faults += drive.tell(pose_at(*HERE, frame=frame), after=0.5).faults
    return faults


def restarted(drive, config, order_state=None):
    """A robot that goes on from the ledger of another one."""
    again = Drive(HERE, config=config)
    before = drive.mission.snapshot()
    again.mission.restore(before, order_state or OrderState.from_json(before.note))
    return again


def codes(faults):
    return [fault.code for fault in faults if fault.code != "wrong_frame"]


def on_another_floor(config=WITH_ALL):
    """A robot that has taken a lift from ``map_1`` to ``map_2``, and all faults there."""
    drive = Drive(HERE, *floor("map_1"), config=config)
    drive.plan()
    return drive, stand(drive, "map_2", 14)


def test_keep_outs_of_another_floor_leave_the_robot_standing():
    """Its own ones are not known there: it must not drive without any."""
    drive, faults = on_another_floor()
    assert drive.mission.grid.frame == "map_2"
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason == (
        "mission.zones, mission.keep_out, mission.home: given for the map in frame 'map_1' "
        "(mission.map_frame), this one is in 'map_2': waits "
        "until this map has places, or the other map is back"
    )
    assert drive.walk == []
    assert codes(faults) == ["ledger_mismatch", "places_elsewhere"], "each is said once"
    assert "mission reset" in PlacesElsewhere.hint


def test_back_on_their_floor_the_places_count_again():
    drive, _ = on_another_floor()
    stand(drive, "map_1", 14)
    assert drive.mission.state is not State.BLOCKED
    assert drive.mission.orders.goal() == (4, 8)


def test_the_floor_of_the_places_survives_a_restart():
    drive, _ = on_another_floor()
    again = restarted(drive, WITH_ALL)
    assert codes(stand(again, "map_2", 2)) == ["places_elsewhere"]
    assert again.mission.state is State.BLOCKED


def test_a_frame_of_the_configuration_counts_from_the_start():
    drive = Drive(HERE, *floor("map_2"), config=with_policy(WITH_ALL, map_frame="map_1"))
    assert drive.mission.state is State.BLOCKED
    drive = Drive(HERE, *floor("map_1"), config=with_policy(WITH_ALL, map_frame="map_1"))
    assert drive.request is not None


def test_places_changed_in_the_configuration_fit_the_current_map():
    drive, _ = on_another_floor()
    again = restarted(drive, with_policy(WITH_ALL, home=Place(x_m=0.4, y_m=0.4)))
    assert codes(stand(again, "map_2", 2)) == []
    assert again.mission.state is not State.BLOCKED
    assert again.mission.orders.goal() == HERE


def test_a_reset_takes_the_places_for_those_of_the_map_in_use():
    drive, _ = on_another_floor()
    drive.command("reset")
    drive.command("start")
    assert codes(stand(drive, "map_2", 2)) == []
    assert drive.mission.state is not State.BLOCKED
    assert drive.mission.orders.goal() == (4, 8)


def test_zones_and_home_of_another_floor_are_not_used_there():
    drive, faults = on_another_floor(WITHOUT_KEEP_OUT)
    assert codes(faults) == ["ledger_mismatch", "places_elsewhere"]
    assert drive.mission.state in (State.PLANNING, State.COVERING)
    assert drive.mission.orders.goal() == HERE, "where the order began here"
    drive.command("start", {"zones": [{"name": "kitchen"}]})
    assert drive.refused.code == "bad_order"
    assert "given for the map in frame 'map_1'" in str(drive.refused)
    stand(drive, "map_1", 14)
    drive.command("start", {"zones": [{"name": "kitchen"}]})
    assert drive.refused is None


def test_a_robot_does_not_go_to_the_dock_of_another_floor():
    dock = Dock(x_m=0.4, y_m=0.4, approach_m=0.0)
    config = replace(with_policy(CONFIG, dock=dock), battery=BatteryPolicy())
    drive, _ = on_another_floor(config)
    for _ in range(12):
        drive.tell(BatteryReceived(0.15, "discharging"), pose_at(*HERE, frame="map_2"), after=1.0)
        drive.plan() if drive.request is not None else None
    assert drive.mission.order_state.errand == ""
    assert drive.mission.state is State.DEGRADED
    assert drive.mission.reason.startswith("the robot does not go to charge: mission.dock: given")


def test_places_in_another_buildings_frame_are_not_used():
    """The same frame, and a map that is not the one that they were given for."""
    drive = Drive(HERE, *floor("map"), config=WITH_ALL)
    drive.plan()
    faults = stand(drive, "map", 9, OTHER)
    assert codes(faults) == ["ledger_mismatch", "places_elsewhere"]
    assert drive.mission.state is State.BLOCKED
    assert "given for another building than the map shows" in drive.mission.reason
    again = restarted(drive, WITH_ALL)
    stand(again, "map", 2, OTHER)
    assert again.mission.state is State.BLOCKED
    again.command("reset")
    again.command("start")
    stand(again, "map", 2, OTHER)
    assert again.mission.state is not State.BLOCKED


def test_a_mask_of_the_previous_building_is_not_used():
    """Its frame is that of both maps; one for this building may come, which has the mission begin
    anew, with the mask in its configuration."""
    mask, other = (inline_grid(building("##", at=(row, 2)), 65) for row in (2, 3))
    config = with_policy(CONFIG, keep_out_mask=mask, keep_out_topic=True, home=HOME)
    drive = Drive(HERE, *floor("map"), config=config)
    drive.plan()
    assert codes(stand(drive, "map", 9, OTHER)) == ["ledger_mismatch", "places_elsewhere"]
    assert drive.mission.state is State.BLOCKED
    assert drive.mission.reason.startswith("keep_out_mask: given for another building")
    again = restarted(drive, with_policy(config, keep_out_mask=other))
    stand(again, "map", 2, OTHER)
    assert again.mission.state is not State.BLOCKED
    assert again.mission.orders.goal() == HERE, "and not that of the configuration"


def test_without_places_none_are_reported():
    drive, faults = on_another_floor(CONFIG)
    assert codes(faults) == ["ledger_mismatch"]
    assert drive.mission.state is not State.BLOCKED


@pytest.mark.parametrize("command", ["keep-out zones", "zones"])
def test_an_order_keeps_its_frame_over_a_restart(command):
    drive = Drive(HERE, *floor("map_1"), config=CONFIG)
    corners = rectangle(3, 3, 5, 5)
    zone = {"zones": [{"name": "a", "polygon": corners}]}
    drive.command("start", {"keep_out": [corners]} if command == "keep-out zones" else zone)
    again = Drive(HERE, config=CONFIG)
    again.mission.restore(order=OrderState.from_json(drive.mission.order_state.to_json()))
    again.tell(*floor("map_2"))
    assert again.mission.state is State.IDLE
    assert "it was given in frame 'map_1', the map is in 'map_2'" in again.mission.reason


def test_a_note_of_an_older_daemon_is_read():
    old = (
        '{"version":1,"order":{"passes":1,"keep_out":[],"return_home":false,"keep_covered":true},'
        '"standing":true,"stage":"covering","zone":0,"pass":1,"begun":true,"tries":0,'
        '"home":[1,1],"paused":false,"why":""}'
    )
    state = OrderState.from_json(old)
    assert state.frame == ""
    drive = Drive(HERE, config=WITHOUT_KEEP_OUT, order_state=state)
    drive.tell(*floor("map_1"))
    assert drive.mission.order_state.frame == "map_1"
    assert drive.mission.order_state.places.frame == "map_1"
