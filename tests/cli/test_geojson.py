"""GeoJSON: rooms and lines that other programs read, orders that they draw."""

import json
from itertools import pairwise

import pytest

from fasaco_edge.cli import main
from fasaco_edge.cli.geojson import collection, is_geojson, line_feature, order_of, rooms_collection
from fasaco_edge.errors import OrderError
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms

RING = ((0.0, 0.0), (0.0, 6.0), (6.0, 6.0), (6.0, 0.0))  # clockwise
INNER = ((2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0))
ROOMS = Rooms(
    "map", 4, (RoomReport(1, "ring", RING, 32.0, (2,), (2,), 0.5), RoomReport(2, outline=INNER))
)


def square(**properties):
    corners = [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]]
    geometry = {"type": "Polygon", "coordinates": [corners]}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def test_rooms_are_polygons_with_holes():
    document = json.loads(json.dumps(rooms_collection(ROOMS)))
    assert is_geojson(document)
    assert document["frame"] == "map"
    ring, inner = document["features"]
    outline, hole = ring["geometry"]["coordinates"]
    # RFC 7946: closed; the outline counter-clockwise, holes clockwise.
    assert outline[0] == outline[-1]
    assert signed(outline) == pytest.approx(36.0)
    assert signed(hole) == pytest.approx(-4.0)
    assert ring["properties"]["name"] == "ring"
    assert inner["properties"] | {"room": 2, "name": "room 2"} == inner["properties"]


def signed(ring):
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise(ring))


def test_rooms_that_were_written_are_an_order_for_these_rooms():
    order = read_order(order_of(rooms_collection(ROOMS)))
    assert [(zone.name, zone.room) for zone in order.zones] == [("ring", 1), ("room 2", 2)]


def test_an_order_is_read_as_it_was_drawn():
    drawn = [square(name="kitchen", passes=["auto", "cross"]), square(keep_out=True), square()]
    order = read_order(order_of(collection("map", drawn) | {"return_home": True}))
    assert [zone.name for zone in order.zones] == ["kitchen", "zone 3"]
    assert order.zones[0].passes == 2
    assert order.zones[0].polygon == ((0, 0), (4, 0), (4, 3), (0, 3))
    assert len(order.keep_out) == 1
    assert order.return_home
    assert read_order(order_of(collection("map", []))).zones[0].polygon is None


@pytest.mark.parametrize(
    "geometry",
    [
        None,
        {"type": "Point", "coordinates": [0, 0]},
        {"type": "Polygon", "coordinates": []},
        {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1]]]},
        {"type": "Polygon", "coordinates": [[[0, 0], [9, 0], [9, 9], [0, 0]], [[1, 1]]]},
        {"type": "Polygon", "coordinates": [[["a", 0], [9, 0], [9, 9], ["a", 0]]]},
        {"type": "Polygon", "coordinates": "all"},
    ],
)
def test_a_feature_that_is_no_zone_is_named(geometry):
    drawn = [square(), {"type": "Feature", "geometry": geometry, "properties": None}]
    with pytest.raises(OrderError, match=r"features\[1\]|zones\[1\]"):
        read_order(order_of(collection("map", drawn)))


def test_a_line_is_a_line():
    line = line_feature([(0.0, 0.5), (1.0, 0.5)], {"seconds": 4.0})
    assert line["geometry"] == {"type": "LineString", "coordinates": [[0.0, 0.5], [1.0, 0.5]]}


def test_plan_writes_a_line_and_an_order_is_read_from_a_file(tmp_path, capsys):
    file = tmp_path / "line.geojson"
    words = ["flat", "--planner", "stc", "--line", "quick", "--xy-out", str(file)]
    assert main(["plan", *words, "--json"]) == 0
    share = json.loads(capsys.readouterr().out)["floor"]["swept_share"]
    (line,) = json.loads(file.read_text())["features"]
    assert line["geometry"]["type"] == "LineString"
    assert line["properties"] == {"pass": 1, "swept": pytest.approx(share, abs=1e-4)}
    # A line is no zone: that is said, with the file, without a daemon.
    assert main(["mission", "start", "--order", str(file)]) == 1
    assert f"{file}: features[0]: must be a Polygon, is LineString" in screen(capsys)


def screen(capsys):
    return " ".join(capsys.readouterr().err.split())
