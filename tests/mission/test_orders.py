"""Orders and commands as documents: what is read, and what is refused with which words."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import OrderError
from fasaco_edge.mission.orders.commands import command_document, read_command, read_recorded
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.order import (
    EVERYTHING_ONCE,
    Command,
    MissionOrder,
    Zone,
    order_document,
    read_order,
)
from fasaco_edge.mission.work.order_state import OrderState, Stage
from fasaco_edge.mission.work.reached_cells import ReachedCells
from fasaco_edge.planners.passes import Pass
from tests.support.examples import examples

SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]
REACHED = ReachedCells(-1, 2, 3, 3, b"\xab\x80")
KITCHEN = {"name": "kitchen", "polygon": SQUARE}


def zones(*polygons, **rest):
    named = [{"name": f"z{i}", "polygon": polygon} for i, polygon in enumerate(polygons)]
    return {"zones": named, **rest}


def test_an_empty_order_covers_everything_once():
    assert read_order(None) == read_order({}) == EVERYTHING_ONCE == MissionOrder()
    assert read_order({"passes": 3}).zones == (Zone("everything", None, 3),)


def test_an_order_may_have_all_its_members():
    order = read_order(
        {
            "zones": [KITCHEN, {"name": "hall", "polygon": SQUARE, "passes": 3}],
            "keep_out": [[[0.5, 0.5], [1, 0.5], [1, 1]]],
            "passes": 2,
            "return_home": True,
            "keep_covered": True,
            "until_min": 0.0,
        }
    )
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    assert order.zones == (Zone("kitchen", square, 2), Zone("hall", square, 3))
    assert order.keep_out == (((0.5, 0.5), (1.0, 0.5), (1.0, 1.0)),)
    assert order.return_home
    assert order.keep_covered
    assert order.until_min == 0.0
    assert read_order(json.loads(json.dumps(order_document(order)))) == order


def test_each_pass_may_have_its_cells_lanes_and_speed():
    listed = ["edge", {"covers": "rest", "lanes": "cross"}, "auto", {"lanes": "cross"}]
    with pytest.raises(OrderError, match=r"passes\[1\]: cross goes after a pass with lanes"):
        read_order({"passes": listed})
    listed[1] = {"covers": "rest", "angle_deg": -30.0, "speed_m_s": 0.1}
    order = read_order({"passes": listed, "zones": [KITCHEN, {"name": "hall", "passes": 2}]})
    kitchen, hall = order.zones
    assert (kitchen.passes, hall.passes, hall.kinds) == (4, 2, ())
    assert kitchen.kinds == (
        Pass("edge"),
        Pass("rest", "auto", -30.0, 0.1),
        Pass(),
        Pass(lanes="cross"),
    )
    assert [kitchen.laid(number).lanes for number in (1, 2, 3, 4)] == [
        "",
        "rows",
        "rows",
        "columns",
    ]
    document = json.loads(json.dumps(order_document(order)))
    assert document["zones"][0]["passes"] == [*listed[:3], "cross"]
    assert read_order(document) == order
    # As many equal ones are a number, as older daemons know it.
    assert order_document(read_order({"passes": ["auto", "auto"]}))["passes"] == 2


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ([], "expected a mapping, got []"),
        ({"zone": []}, "zone: unknown key; did you mean zones?"),
        ({"zones": [{"passes": 1}]}, "zones[0].name: missing"),
        ({"zones": [{**KITCHEN, "pass": 1}]}, "did you mean zones[0].passes?"),
        ({"zones": [{**KITCHEN, "name": ""}]}, "zones[0].name: expected a text of at least"),
        ({"zones": [{**KITCHEN, "name": "a\n"}]}, "zones[0].name: must be 1..64 printable"),
        ({"zones": [{**KITCHEN, "name": "x" * 65}]}, "zones[0].name: expected a text of at most"),
        ({"zones": [KITCHEN, KITCHEN]}, "zones[1].name: there is a zone 'kitchen' already"),
        ({"zones": [{**KITCHEN, "passes": 0}]}, "zones[0].passes: expected a whole number of at"),
        ({"passes": True}, "passes: expected a whole number or a list or null, got true"),
        ({"passes": []}, "passes: expected a list of at least 1 item, got []"),
        ({"until_min": -1}, "until_min: expected a number of at least 0, got -1"),
        ({"passes": ["x"]}, "passes[0]: expected auto, cross, edge or rest, got 'x'"),
        ({"passes": [{"lanes": "x"}]}, "passes[0].lanes: expected auto or cross, got 'x'"),
        ({"passes": [{"floor": 1}]}, "passes[0].floor: unknown key; there are covers"),
        ({"passes": [{"covers": 1}]}, "passes[0].covers: expected all, edge or rest, got 1"),
        ({"passes": [{"angle_deg": 361}]}, "passes[0].angle_deg: expected a number of"),
        ({"passes": [{"overlap": 0.6}]}, "passes[0].overlap: expected a number of at"),
        ({"passes": [{"speed_m_s": 0}]}, "passes[0].speed_m_s: expected a number above 0, got 0"),
        ({"passes": ["edge"]}, "passes: edge alone leaves most of the floor"),
        ({"zones": [{**KITCHEN, "passes": ["edge", "cross"]}]}, "cross goes after a pass"),
        (zones([[0, 0], [1, 0]]), "zones[0].polygon: expected a list of at least 3 items"),
        (zones([[0, 0], [1, 0], [1, math.nan]]), "zones[0].polygon[2]: must be finite and within"),
        (zones([[0, 0], [1e9, 0], [1, 1]]), "zones[0].polygon[1]: must be finite and within 2e+07"),
        (zones([[0, 0], [2, 2], [2, 0], [0, 2]]), "zones[0].polygon: crosses or touches itself"),
        (zones([[0, 0], [2, 0], [1, 0]]), "zones[0].polygon: crosses or touches itself"),
        (zones([[0, 0], [0, 0], [1, 1]]), "zones[0].polygon: has point 0 twice in a row"),
        (zones([*SQUARE, [0, 0]]), "zones[0].polygon: must not repeat its first point at the end"),
        (zones([[0, 0], [1e-3, 0], [0, 1e-3]]), "must have an area of at least 0.0001 m2"),
        ({"keep_out": [[[0, 0], [2, 2], [2, 0], [0, 2]]]}, "keep_out[0]: crosses"),
        (zones([[0, 0]] * 1001), "zones[0].polygon: expected a list of at most 1000 items"),
        (zones(*[[[0, 0]] * 1000] * 6), "polygons must have at most 5000 points, got 6000"),
    ],
)
def test_a_wrong_member_is_named(document, said):
    with pytest.raises(OrderError) as caught:
        read_order(document)
    assert said in str(caught.value)
    assert len(str(caught.value)) < 300
    assert (caught.value.code, bool(caught.value.hint)) == ("bad_order", True)
    assert caught.value.rest == ()


def test_a_polygon_of_a_thousand_points_is_no_burden():
    angles = [2 * math.pi * i / 1000 for i in range(1000)]
    read_order(zones([[5 * math.cos(a), 5 * math.sin(a)] for a in angles]))


def test_each_command_is_read():
    assert read_command({"command": "pause"}) == Command("pause")
    assert read_command({"command": "start", "order": {"passes": 2}}).order.zones[0].passes == 2
    for command in (
        Command("reset"),
        Command("reset", discard=True),
        Command("start", TWO),
        Command("keep_out_add", keep_out=KeepOut("vase", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))),
        Command("keep_out_remove", keep_out=KeepOut("vase")),
    ):
        assert read_command(json.loads(json.dumps(command_document(command)))) == command
    for document, said in (
        ({}, "command: missing"),
        (
            {"command": "go"},
            "expected start, pause, resume, home, cancel, reset, replan, status, keep_out_",
        ),
        ({"command": "pause", "order": {}}, "order: goes with start alone"),
        ({"command": "pause", "discard": True}, "discard: goes with start and reset alone"),
        ({"command": "pause", "keep_out": {"name": "a"}}, "keep_out: goes with keep_out_add and"),
        ({"command": "keep_out_add"}, "keep_out: goes with keep_out_add and keep_out_remove, m"),
        (added({}), "keep_out.name: missing"),
        (added({"name": "a"}), "keep_out.polygon: goes with keep_out_add, missing"),
        (added({"name": " a", "polygon": SQUARE}), "keep_out.name: must be 1..64 printable"),
        (added({"name": "a", "polygon": [[0, 0], [2, 2], [2, 0], [0, 2]]}), "polygon: cro"),
        (added({"name": "a", "polygon": [[0, 0], [1, 0], [1, math.nan]]}), "polygon[2]: m"),
        (
            {"command": "keep_out_remove", "keep_out": {"name": "a", "polygon": SQUARE}},
            "got it with keep_out_remove",
        ),
    ):
        with pytest.raises(OrderError) as caught:
            read_command(document)
        assert said in str(caught.value)


def added(keep_out):
    return {"command": "keep_out_add", "keep_out": keep_out}


def test_recorded_commands_without_a_consent_member_had_consent():
    assert read_recorded({"command": "reset"}).discard
    assert read_recorded({"command": "start"}).discard
    assert not read_recorded({"command": "reset", "discard": False}).discard
    assert read_recorded({"command": "pause"}) == Command("pause")


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["zones", "name", "polygon", "passes", "keep_out", "x"]), inner
        )
    ),
    max_leaves=15,
)


@examples(300)
@given(anything)
def test_any_document_is_an_order_or_is_refused(document):
    try:
        order = read_order(document)
    except OrderError:
        return
    assert read_order(order_document(order)) == order


TWO = read_order(zones(SQUARE, SQUARE, passes=2))
VASE = KeepOut("vase", ((0.5, 0.5), (1.0, 0.5), (1.0, 1.0)))


def test_the_legs_of_an_order():
    leg, titles = OrderState(TWO), []
    while True:
        titles.append(leg.title)
        if leg.next_pass() is leg:
            break
        leg = leg.next_pass()
    assert titles == [f"zone 'z{zone}', pass {turn} of 2" for zone in (0, 1) for turn in (1, 2)]
    assert OrderState.autostart().title == "everything reachable"


@pytest.mark.parametrize(
    "order_state",
    [
        OrderState.autostart(),
        OrderState.idle("cancelled"),
        OrderState(TWO, paused=True, zone=1, pass_number=2, begun=True, home=(-3, 4)),
        OrderState(TWO, stage=Stage.RETRYING, tries=2),
        OrderState(MissionOrder(return_home=True), stage=Stage.OVER),
        OrderState.idle("cancelled").commanded(Command("keep_out_add", keep_out=VASE)),
        OrderState(TWO, errand="home", paused=True, home=(2, 1), keep_out=(VASE,)),
        OrderState(TWO, reached=REACHED),
    ],
)
def test_a_stored_state_is_read_back(order_state):
    assert OrderState.from_json(order_state.to_json()) == order_state


@pytest.mark.parametrize(
    "change",
    [
        {"version": 2},
        {"zone": 2},
        {"zone": -1},
        {"pass": 3},
        {"pass": 0},
        {"stage": "dancing"},
        {"home": [1]},
        {"reached": {"row0": 0, "col0": 0, "rows": 3, "cols": 3, "bits": "AA=="}},
        {"reached": {"row0": 0, "col0": 0, "rows": 900_000, "cols": 1, "bits": "AAA="}},
        {"more": 1},
        {"order": {"zones": [{"name": "a", "polygon": [[0, 0], [0, 0], [0, 0]]}]}},
        {"keep_out": [{"name": "a", "polygon": [[0, 0], [0, 0], [0, 0]]}]},
        {"keep_out": [{"name": "a", "polygon": SQUARE}] * 101},
        {"last": {"zones": [{"name": "a", "polygon": [[0, 0], [0, 0], [0, 0]]}]}},
    ],
)
def test_a_note_that_cannot_be_right_is_refused(change):
    note = json.loads(OrderState(TWO).to_json()) | change
    with pytest.raises(OrderError):
        OrderState.from_json(json.dumps(note))
    for torn in ("", "{", "[]", "null", '{"version":1}'):
        with pytest.raises(OrderError):
            OrderState.from_json(torn)


def test_a_cancelled_order_is_kept_until_another_or_another_place():
    dropped = OrderState(TWO, zone=1).commanded(Command("cancel"))
    for state in (dropped, dropped.commanded(Command("cancel"))):
        assert OrderState.from_json(state.to_json()).last == TWO
    assert OrderState(TWO, stage=Stage.OVER).commanded(Command("cancel")).last == TWO
    begun = dropped.commanded(Command("start", EVERYTHING_ONCE))
    assert (begun.order, begun.last) == (EVERYTHING_ONCE, None)
    assert dropped.commanded(Command("reset")).last is None
    assert dropped.in_other_building("elsewhere").last is None
    assert OrderState.autostart().commanded(Command("cancel")).last is None
