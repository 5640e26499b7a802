"""Questions to a recording: why the robot turned round, and why a spot is not swept."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs
from PIL import Image

pytest.importorskip("rerun")

from fasaco_edge.cli import main
from fasaco_edge.drawing import palette
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.conversion import document_of
from fasaco_edge.review.floor_and_rooms import swept_floor
from fasaco_edge.review.instant import MapThen, instant_at
from fasaco_edge.review.output.answers import instant_rows
from fasaco_edge.review.output.pictures import draw_spots, spot_lines
from fasaco_edge.review.output.rows import screen_rows
from fasaco_edge.review.review import read_review
from fasaco_edge.review.spot import explain
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.replies import FloorReport
from fasaco_edge.wire.messages.paths import encode_path
from tests.support.recordings import read_column, told_recorder
from tests.support.rooms import UNKNOWN, WALL, fill, map_bytes, pose_bytes, room

CONFIG = {"robot": {"tool_width_m": 0.3, "radius_m": 0.18}, "planner": {"line": "thorough"}}
KEEP_OUT = [[2.6, 0.4], [3.4, 0.4], [3.4, 1.0], [2.6, 1.0]]
ZONE = [[0.1, 0.1], [3.9, 0.1], [3.9, 2.3], [0.1, 2.3]]
# Of a configured zone, by its name: the status has its polygon.
ORDER = {"zones": [{"name": "a"}], "keep_out": [KEEP_OUT], "return_home": True}
Y = 0.45


def ground():
    """Return a room with a corner never seen, a box, a niche of 20 cm and a closed chamber."""
    pixels = fill(room(6.0, 3.0), 5.0, 0.0, 6.0, 3.0, UNKNOWN)
    pixels = fill(pixels, 4.0, 0.0, 4.1, 3.0, WALL)
    pixels = fill(pixels, 2.0, 2.0, 2.4, 2.4, WALL)
    return fill(pixels, 2.6, 2.0, 3.0, 3.0, WALL)


def seen_first():
    return fill(ground(), 0.0, 1.2, 4.0, 1.6, UNKNOWN)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("questions") / "runs"
    with told_recorder(folder, 0.04) as told:

        def path(revision, reason, xs, y=Y, **more):
            xy = np.array([(x, y) for x in xs])
            note = {"revision": revision, "reason": reason, "planner": "aco", "steps": 3}
            told.tell("path", encode_path(xy, np.zeros(len(xy)), "map", 1), note | more)

        def status(state, reason, **more):
            said = {"robot": "robot", "state": state, "reason": reason, "config": CONFIG}
            mission = {"zones": [{"name": "a", "polygon": ZONE}] if told.sent > 2 else []}
            mission["keep_outs"] = [{"polygon": KEEP_OUT, "by": "order"}] if told.sent > 2 else []
            told.tell("status", encode_json(said | {"mission": mission | more}))

        told.tell("map", map_bytes(seen_first()))
        status("idle", "waits for an order")
        told.tell("command", encode_json({"command": "start", "order": ORDER}))
        status("covering", "path 1")
        saved = {"saved_by_velocity_s": {"6": 14.0}, "saved_by_local_search_s": 2.0}
        path(1, "first plan", [0.45, 2.0], ants=32, **saved)
        for x in np.arange(0.45, 1.4, 0.15):
            told.tell("pose", pose_bytes(float(x), Y))
        told.tell("map", map_bytes(ground()))
        box = {"x_min": 1.0, "y_min": 1.2, "x_max": 2.0, "y_max": 1.6}
        path(2, "map: 3 cells more", [1.35, 0.3], changed=box)
        for yaw in np.linspace(0.0, math.pi, 6):
            told.tell("pose", pose_bytes(1.35, Y, yaw=float(yaw)))
        for x in np.arange(1.2, 0.4, -0.15):
            told.tell("pose", pose_bytes(float(x), Y, yaw=math.pi))
        told.tell("command", encode_json({"command": "pause"}))
        area = {"cells": 4, "m2": 0.36, "x": 3.0, "y": 0.7, "reason": "in a keep-out zone"}
        status("paused", "paused by command", unreached={"areas": [area]})
        told.end()
    return sorted(folder.glob("*.rrd"))


@pytest.fixture(scope="module")
def review(parts):
    return read_review(parts)


def turned_s(review):
    """Return when the robot stood half turned [s]."""
    yaws = [yaw for _, _, yaw in review.data.poses]
    return review.data.pose_s[next(i for i, yaw in enumerate(yaws) if yaw > 1.0)]


def test_a_turn_of_the_robot_is_explained(review):
    instant = instant_at(review, turned_s(review)).instant
    assert (instant.state, instant.x, instant.y) == ("covering", 1.35, Y)
    assert instant.turn.degrees == pytest.approx(180.0, abs=1.0)
    assert instant.turn.why == (
        "path 2 came (map: 3 cells more) and leads west, where path 1 led east"
    )
    paths = instant.path_before, instant.path, instant.path_after
    assert [path.revision if path else None for path in paths] == [1, 2, None]
    assert [round(path.leads_deg) for path in paths[:2]] == [0, 180]
    assert instant.path.changed.x_max == 2.0


def test_a_stretch_sweeps_new_floor_or_is_a_way(review):
    first = instant_at(review, review.data.pose_s[0]).instant
    assert 0.0 < first.sweeps_new_m2 < first.sweeps_m2
    words = dict(instant_rows(first))["sweeps"]
    assert words.endswith(f" of {first.sweeps_m2:.2f} m2 for the first time, in the next 10 s")
    # Back on the line along which it came.
    back = instant_at(review, turned_s(review)).instant
    assert back.sweeps_new_m2 == 0.0 < back.sweeps_m2


def test_changes_of_the_map_and_commands_are_listed(review):
    instant = instant_at(review, turned_s(review)).instant
    # A band of 40 cm across the room, of which the box and two walls are no floor.
    assert instant.map.seen_m2 == pytest.approx(0.4 * 4.0, abs=0.05)
    assert instant.map.around.y_min == pytest.approx(1.2, abs=0.06)
    assert instant.command.command.startswith("start: zone a, keep out of (2.6, 0.4)")
    assert instant.command.command.endswith("return home")
    assert instant.next_command.command == "pause"
    told = dict(instant_rows(instant))
    assert told["order"].startswith("zone a, keep out of")
    assert "seen for the first time" in told["map"]
    quiet = structs.replace(instant, map=MapThen(3.0, 0.0, 0.0, 0.0, None))
    assert dict(instant_rows(quiet))["map"] == "no change in the 5 s before"
    assert "facing" in told["robot"]


def test_the_search_that_found_the_path_is_named(review):
    instant = instant_at(review, review.data.paths[0].at_s).instant
    planned = dict(instant_rows(instant))["planned"]
    assert planned.startswith("1 at 0:0")
    found = "ants of velocity 6 saved 14.0 s, local search saved 2.0 s"
    assert planned.endswith(f": first plan; aco, 32 ants; {found}")


def test_before_the_first_message_nothing_is_known(review):
    first = min(review.data.map_s[0], review.data.pose_s[0])
    instant = instant_at(review, max(first - 0.01, 0.0)).instant
    assert instant.path is instant.x is instant.command is None


@pytest.mark.parametrize(
    ("place", "why", "words"),
    [
        ((0.9, Y), "swept", "first at 0:0"),
        # Of the path back the robot drove all but the last 15 cm.
        ((0.2, Y), "still to come", "the robot did not get there"),
        ((9.0, 1.0), "never seen", "unknown to the map"),
        ((5.5, 1.0), "never seen", "unknown to the map"),
        ((2.2, 2.2), "not floor", "an obstacle (100 %)"),
        ((3.0, 0.7), "keep-out", "in a keep-out zone of the order"),
        ((2.5, 2.2), "too narrow", "its tool reaches 0.15 m"),
        ((4.5, 1.0), "closed off", "no way leads there"),
        ((1.0, 2.5), "not ordered", "in no zone of the last order"),
        (
            (1.75, Y),
            "missed",
            "path 1 led over it, until path 2 took its place (map: 3 cells more)",
        ),
        ((0.9, 1.4), "seen late", "the tool's edge passed 80 cm from it"),
        ((0.9, 0.7), "not worth it", "the tool's edge passed 10 cm from it"),
    ],
)
def test_the_reason_of_an_unswept_spot_is_found(review, place, why, words):
    (spot,) = explain(review, [place])
    assert spot.why == why
    assert words in spot.words
    assert spot.swept is (why == "swept")
    assert spot_lines([spot])[0].startswith("at: ")
    # In the picture each mark has its number.
    assert {line.split()[0] for line in spot_lines([spot, spot])} == {"1", "2"}


def test_floor_of_a_time_without_poses_is_not_called_missed(review):
    """The robot drove there twice, but poses came only from both ends."""
    data = review.data
    kept = [i for i, (x, *_) in enumerate(data.poses) if not 0.5 < x < 1.3]
    some = replace(data, poses=[data.poses[i] for i in kept], pose_s=[data.pose_s[i] for i in kept])
    floor = swept_floor(some, review.lattice)
    lost = replace(review, data=some, floor=floor, all_floor=floor)
    (spot,) = explain(lost, [(0.9, Y)])
    assert (spot.why, spot.swept) == ("poses missing", None)
    first, end = (
        some.pose_s[0],
        next(at for at, pose in zip(some.pose_s, some.poses, strict=True) if pose[0] > 1.3),
    )
    assert f"no pose came between {clock(first)} and {clock(end)}" in spot.words
    assert dict(screen_rows(lost, document_of(lost)))["poses"].startswith("2 gaps over 2 m: floor")
    assert "poses" not in dict(screen_rows(review, document_of(review)))
    # The picture does not show a drive there; and what lies far off is missed as before.
    colours = [
        {colour for _, colour in draw_spots(each, [spot]).getcolors(maxcolors=1 << 20)}
        for each in (review, lost)
    ]
    assert [palette.ORANGE in found for found in colours] == [False, True]
    (spot,) = explain(lost, [(0.9, 1.4)])
    assert spot.why == "not worth it"


def with_floor(review, *swept_m2):
    first, last = review.data.statuses[0], review.data.statuses[-1]
    times = np.linspace(first.at_s, last.at_s, len(swept_m2))
    said = [
        replace(last, at_s=at_s, status=structs.replace(last.status, floor=FloorReport(m2)))
        for at_s, m2 in zip(times, swept_m2, strict=True)
    ]
    return replace(review, data=replace(review.data, statuses=said))


def test_floor_swept_before_the_recording_is_not_called_left(review):
    """A recorder that joins later has no poses of it."""
    late = with_floor(review, 2.0, 2.3)
    (spot,) = explain(late, [(0.9, 0.7)])
    assert (spot.why, spot.swept) == ("not known", None)
    assert "before the recording 1.9 m2 were swept" in spot.words
    assert document_of(late).swept_before_m2 == pytest.approx(1.9, abs=0.05)
    swept = dict(screen_rows(late, document_of(late)))["floor swept"]
    assert swept.endswith("by recorded poses, and 1.9 m2 before the recording")
    # The floor of an order before this one is none of it.
    for told in (with_floor(review, 2.0, 0.0, 0.3), with_floor(review, 0.0, 0.3)):
        (spot,) = explain(told, [(0.9, 0.7)])
        assert (spot.why, spot.swept) == ("not worth it", False)
        assert document_of(told).swept_before_m2 == 0.0


def test_by_how_much_it_was_missed(review):
    (spot,) = explain(review, [(0.9, 0.7)])
    assert spot.missed_m == pytest.approx(0.10, abs=1e-3)
    x, y, _ = review.data.poses[review.data.pose_s.index(pytest.approx(spot.nearest_s, abs=1e-3))]
    assert (x, y) == pytest.approx((0.9, Y), abs=0.16)
    assert spot.patch_m2 > 1.0
    assert spot.seen_s == pytest.approx(review.data.map_s[0], abs=1e-3)


def test_a_spot_without_a_map_is_not_known(review):
    bare = replace(review, data=replace(review.data, grid=None), no_lattice="there is no map")
    (spot,) = explain(bare, [(1.0, 1.0)])
    assert (spot.swept, spot.words) == (None, "there is no map")


def test_zones_are_drawn_for_the_viewer(parts):
    zones = read_column(parts[0], entities.ZONES, "LineStrips3D:strips").values[-1]
    assert np.allclose(np.asarray(zones[0])[:, :2], [*ZONE, ZONE[0]], atol=1e-6)
    kept = read_column(parts[0], entities.KEEP_OUT, "LineStrips3D:strips").values[-1]
    assert np.allclose(np.asarray(kept[0])[:, :2], [*KEEP_OUT, KEEP_OUT[0]], atol=1e-6)


@pytest.mark.parametrize("option", ["--at", "--point"])
def test_the_command_answers(parts, review, tmp_path, capsys, option):
    # A busy computer takes longer than a second to the first pose.
    asked = f"{review.data.pose_s[-1]:.3f}" if option == "--at" else "-0.5,0.7"
    option = option, asked
    picture = tmp_path / "answer.png"
    assert main(["review", *map(str, parts), *option, "--png", str(picture)]) == 0
    assert "robot" in capsys.readouterr().out or option[0] == "--point"
    with Image.open(picture) as image:
        colours = {colour for _, colour in image.getcolors(maxcolors=1 << 20)}
    assert {palette.BLUE, palette.VERMILION} <= colours
    assert main(["review", *map(str, parts), *option, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["at" if option[0] == "--at" else "points"]


@pytest.mark.parametrize(
    ("text", "said"), [("9:59", "the recording is 0:0"), ("1:x", "MM:SS"), ("nan", "MM:SS")]
)
def test_an_invalid_time_is_named(parts, capsys, text, said):
    try:
        code = main(["review", *map(str, parts), "--at", text])
    except SystemExit as ended:
        code = ended.code
    assert code in (2, 78)
    assert said in capsys.readouterr().err


def test_a_review_fits_on_one_screen_and_cuts_nothing(parts, review, capsys, terminal_width):
    terminal_width(80)
    assert main(["review", *map(str, parts)]) == 0
    out = capsys.readouterr().out
    assert len(out.splitlines()) <= 24
    assert max(map(len, out.splitlines())) <= 80
    told = " ".join(out.split())
    # Floor that was not ordered is not left: the zone ends at y = 2.3 m, the room at 3 m.
    assert " of a, by recorded poses" in told
    for name, text in screen_rows(review, document_of(review)):
        assert f"{name} {text}" in told
    assert "start: zone a, keep out of (2.6, 0.4) (3.4, 0.4) (3.4, 1) (2.6, 1), return home" in told
    assert main(["review", *map(str, parts), "--long"]) == 0
    full = capsys.readouterr().out
    for title in ("Orders", "Commands", "Not reached", "Floor left", "Replans"):
        assert title in full
