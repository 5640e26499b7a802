"""GeoJSON: rooms and lines that other programs read, orders that they draw."""

import json
from itertools import pairwise

import pytest

from fasaco_edge.cli import main
from fasaco_edge.cli.geojson import drawn_order, is_geojson, read_order_file, rooms_collection
from fasaco_edge.errors import OrderError, together
from fasaco_edge.mission.orders.order import order_of
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms

RING = ((0.0, 0.0), (0.0, 6.0), (6.0, 6.0), (6.0, 0.0))  # clockwise
INNER = ((2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0))
ROOMS = Rooms(
    "map", 4, (RoomReport(1, "ring", RING, 32.0, (2,), (2,), 0.5), RoomReport(2, outline=INNER))
)


def read(document):
    order, faults = drawn_order(json.loads(json.dumps(document)))
    if faults:
        raise together(faults)
    return order_of(order)


def collection(features):
    return {"type": "FeatureCollection", "features": features}


SQUARE = [[0, 0, 9], [4, 0, 9], [4, 3, 9], [0, 3, 9], [0, 0, 9]]  # with a height


def square(**properties):
    geometry = {"type": "Polygon", "coordinates": [SQUARE]}
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


def test_an_order_is_read_as_it_was_drawn():
    drawn = [square(name="kitchen", passes=["auto", "cross"]), square(keep_out=True), square()]
    order = read(collection(drawn) | {"return_home": True, "until_min": 40})
    assert [zone.name for zone in order.zones] == ["kitchen", "zone 3"]
    assert order.zones[0].passes == 2
    assert order.zones[0].polygon == ((0, 0), (4, 0), (4, 3), (0, 3))
    assert len(order.keep_out) == 1
    assert (order.return_home, order.until_min) == (True, 40)


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
    with pytest.raises(OrderError) as caught:
        read(collection(drawn))
    assert caught.value.key.startswith("features[1].geometry")


def test_a_keep_out_or_skipped_feature_is_no_zone():
    room = square(room=3, name="bath")
    drawn = [room | {"properties": room["properties"] | more} for more in KEPT]
    order = read(collection([*drawn, square(name="hall", priority=90)]))
    assert [(zone.name, zone.priority) for zone in order.zones] == [("hall", 90)]
    assert order.keep_out == (((0, 0), (4, 0), (4, 3), (0, 3)),)
    with pytest.raises(OrderError, match="keep_out: expected true or false"):
        read(collection([square(keep_out="true")]))


KEPT = ({"keep_out": True}, {"skip": True})


@pytest.mark.parametrize("features", [{}, {"features": []}, {"features": {"0": 1}}])
def test_a_file_without_features_is_refused(features):
    with pytest.raises(OrderError, match=r"^features: "):
        read({"type": "FeatureCollection"} | features)


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
    assert f"{file}, line 1: features[0].geometry: must be a Polygon, is LineString" in screen(
        capsys
    )


HOLE = [[1, 1], [2, 1], [2, 2], [1, 1]]
CROSSING = [[0, 0], [4, 3], [4, 0], [0, 3], [0, 0]]
COLLECTION = {"type": "FeatureCollection"}


@pytest.mark.parametrize(
    ("feature", "members", "line", "key", "said"),
    [
        ({"rings": [SQUARE, HOLE]}, {}, 5, "geometry.coordinates", "one ring, got 2"),
        ({"rings": [CROSSING]}, {}, 5, "geometry.coordinates[0]", "crosses or touches itself"),
        ({"passes": 0}, {}, 5, "properties.passes", "got 0 (feature 'hall')"),
        ({"pases": 2}, {}, 5, "properties.pases", "did you mean features[1].properties.passes?"),
        ({"name": None, "id": 7, "passes": 0}, {}, 5, "properties.passes", "(feature 7)"),
        (
            {"stroke": "red"},
            {"passes": 0},
            8,
            "passes",
            "expected a whole number of at least 1, got 0",
        ),
        ({}, {"return-home": 1}, 8, "return-home", "did you mean return_home?"),
        ({}, {"type": "Feature"}, 8, "type", "expected FeatureCollection, got 'Feature'"),
    ],
)
def test_faults_of_a_drawn_order_have_key_line_and_feature(
    tmp_path, feature, members, line, key, said
):
    properties = {"name": "hall"} | feature
    rings, number = properties.pop("rings", [SQUARE]), properties.pop("id", None)
    drawn = square(**properties) | {"geometry": {"type": "Polygon", "coordinates": rings}}
    drawn |= {} if number is None else {"id": number}
    drawn = [square(keep_out=True), drawn]
    top = {} if "type" in members else COLLECTION
    lines = [f"{json.dumps(top)[:-1]}{',' if top else ''}", '\t"features":', "["]
    lines += [*map(json.dumps, drawn), "]"]
    lines[3] += ","
    lines += [f", {json.dumps({name: value})[1:-1]}" for name, value in members.items()]
    file = tmp_path / "evening.geojson"
    file.write_text("\n".join([*lines[:6], "", *lines[6:], "}"]))
    with pytest.raises(OrderError) as caught:
        read_order_file(file)
    error = caught.value
    assert (error.file, error.line, error.rest) == (file, line, ())
    assert error.key == (key if members else f"features[1].{key}")
    assert said in error.what


HALL = "zones:\n  - name: hall\n    pases: 2\n"
BARE = {"type": "Feature", "properties": {}, "geometry": None}


@pytest.mark.parametrize(
    ("name", "text", "places"),
    [
        ("a.yaml", HALL, [(3, "zones[0].pases")]),
        ("a.yaml", "passes: 2\npasses: 3\n", [(2, "passes")]),
        ("a.yaml", "# cut off", [(None, "")]),
        ("a.json", "null", [(None, "")]),
        ("a.json", "[" * 5000 + "]" * 5000, [(None, "")]),
        ("a.yaml", "passes: 1e0\nuntil_min: 1.5e1\n", [(1, "passes")]),
        (
            "a.yaml",
            f"{HALL}    polygon: [[0, 0]]\n  - name: hall\n"
            "keep_out: [[[1, 1]], 7]\nuntil_min: -3\n",
            [
                *((3, "zones[0].pases"), (4, "zones[0].polygon"), (5, "zones[1].name")),
                *((6, "keep_out[0]"), (6, "keep_out[1]"), (7, "until_min")),
            ],
        ),
        (
            "a.geojson",
            json.dumps({"type": "FeatureCollection", "features": [BARE, BARE]}),
            [(1, "features[0].geometry"), (1, "features[1].geometry")],
        ),
    ],
)
def test_all_faults_of_an_order_have_their_lines(tmp_path, name, text, places):
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(OrderError) as caught:
        read_order_file(file)
    faults = [caught.value, *caught.value.rest]
    assert [(fault.line, fault.key) for fault in faults] == places


def test_a_zone_may_replace_keys_of_another_that_it_merges(tmp_path):
    file = tmp_path / "a.yaml"
    file.write_text("zones:\n  - &a {name: a, passes: 2}\n  - {<<: *a, name: b}\n")
    assert [(zone.name, zone.passes) for zone in read_order_file(file).zones] == [
        *(("a", 2), ("b", 2)),
    ]


def screen(capsys):
    return " ".join(capsys.readouterr().err.split())
