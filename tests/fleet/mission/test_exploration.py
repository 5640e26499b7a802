"""Exploration in a fleet: a zone behind another robot is waited for."""

from dataclasses import replace

from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.mission.events import MapReceived, MemberReceived
from fasaco_edge.mission.work.order_state import OrderState
from tests.mission.world import (
    CELL,
    CONFIG,
    Drive,
    building,
    pose_at,
    rectangle,
    with_policy,
)


def test_a_zone_behind_a_robot_that_stands_is_waited_for():
    """Cells seen past it alone were tried in one step, and the order was over, it said."""
    there = MemberReceived("r2", state="paused", x=8.5 * CELL, y=0.5 * CELL, epoch=1, radius_m=0.1)
    config = with_policy(CONFIG, retries=2, retry_s=30.0)
    drive = Drive(
        (0, 0), config=config, order_state=OrderState.idle("no order yet"), kind=FleetKind("r1")
    )
    rows = ["." * 16 + " " * 14]
    drive.tell(MapReceived(building(*rows)), pose_at(0, 0), there)
    drive.command("start", {"zones": [{"name": "z", "polygon": rectangle(0, 20, 1, 24)}]})
    for _ in range(40):
        if drive.request is not None:
            drive.plan()
        if drive.walk and drive.walk[0][1] < 7:
            drive.cell = drive.walk.pop(0)
        drive.tell(pose_at(*drive.cell), there, after=1.0)
    assert drive.mission.state == "covering"
    assert drive.mission.reason == "others stand in the way to zone 'z'"
    away = replace(there, x=100.0)
    drive.tell(MapReceived(building("." * 30)), away, after=1.0)
    for _ in range(80):
        if drive.request is not None:
            drive.plan()
        drive.go(away)
    assert drive.mission.reason == "every reachable cell of the zones is covered"
    assert {(0, col) for col in range(20, 24)} <= drive.visited
