"""Each order of a recording has a verdict of its own; two runs compare where they can."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from fasaco_edge.cli.review.screen import print_comparison
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.order import Command, read_order
from fasaco_edge.mission.orders.room_requests import RoomRequest
from fasaco_edge.review.comparison import (
    compared_rows,
    setup_differences,
    setup_words,
    side_by_side,
)
from fasaco_edge.review.document import MapSize, ReviewDocument
from fasaco_edge.review.moments import spans_of
from fasaco_edge.review.orders import OrderChapter, chapters, commands_of, order_words
from fasaco_edge.review.output.answers import verdicts
from fasaco_edge.review.run_data import PathSample, RunData, StatusSample
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.replies import CoverageReport, MissionReport, ZoneReport
from fasaco_edge.wire.documents.status import Status

ALL = read_order({})
KITCHEN = read_order({"zones": [{"name": "k", "polygon": [[0, 0], [4, 0], [4, 3]], "passes": 1}]})


def received(commands):
    return [(at_s, Command(name, order)) for at_s, name, order in commands]


def told(*rows, commands=()):
    statuses = [
        StatusSample(
            at_s,
            Status(state=state, coverage=CoverageReport(covered=covered, coverable=coverable)),
        )
        for at_s, state, covered, coverable in rows
    ]
    states = spans_of([(at_s, state, "") for at_s, state, _, _ in rows], 100.0)
    data = RunData(statuses=statuses, commands=received(commands))
    return chapters(data, states, 100.0)


def test_three_orders_have_three_verdicts():
    orders = told(
        (0, "covering", 0, 60),
        (20, "done", 60, 60),
        (30.1, "covering", 2, 20),
        (40, "covering", 9, 20),
        (50.1, "covering", 1, 60),
        (90, "done", 52, 56),
        commands=[(30, "start", KITCHEN), (45, "pause", ALL), (50, "start", ALL)],
    )
    assert [order.complete for order in orders] == [True, False, False]
    cells = [(order.covered_cells, order.coverable_cells) for order in orders]
    assert cells == [(60, 60), (9, 20), (52, 56)]
    assert [order.ended_by for order in orders] == ["start", "start", None]
    document = ReviewDocument(complete=False, orders=list(orders))
    assert [text for _, text in verdicts(document)] == [
        "order 1, begun by itself, 0:00.0 to 0:30.0: complete, 60 of 60 cells",
        "order 2 of k, ordered, 0:30.0 to 0:50.0: not complete: covering when another order came, "
        "9 of 20 cells",
        "order 3, ordered, 0:50.0 to 1:40.0: not complete: done at the end of the recording, "
        "52 of 56 cells",
    ]


def test_the_first_plan_of_each_order_is_no_replan():
    paths = [
        PathSample(at_s, PathAttachment(revision=revision, planner="colony-search"))
        for revision, at_s in enumerate((1.0, 5.0, 9.0, 21.0, 25.0), 1)
    ]
    states = spans_of([(0.0, "covering", "")], 100.0)
    data = RunData(paths=paths, commands=received([(20.0, "start", KITCHEN)]))
    assert [order.replans for order in chapters(data, states, 100.0)] == [2, 1]


def test_the_time_of_a_pause_is_rounded():
    (order,) = told((0, "covering", 0, 9), (0.1, "paused", 0, 9), (0.3, "covering", 0, 9))
    assert order.paused_s == 0.2


def test_an_order_of_zones_is_judged_by_these():
    (order,) = restarted(MissionReport("command", zones=(ZoneReport("kitchen", 2, 1, 9, 9),)))
    assert (order.ordered, order.complete) == ("command", True)
    assert (order.covered_cells, order.coverable_cells) == (9, 9)
    assert order_words(order.order) == "zone kitchen 2 times"
    document = ReviewDocument(complete=True, orders=[order], swept_m2=4.7, reachable_m2=4.9)
    words = "complete: every cell of kitchen covered; 4.7 of 4.9 m2 (95.9 %) of its floor swept"
    assert verdicts(document) == [(True, words)]


@pytest.mark.parametrize("ordered", ["command", "itself", None])
def test_an_order_keeps_its_origin_over_a_restart(ordered):
    (order,) = restarted(MissionReport(ordered))
    assert (order.ordered, order.order) == (ordered or "itself", None)
    assert (order.at_s, order.until_s) == (0.0, 100.0)


def test_a_robot_that_waited_for_its_first_order_had_none_before():
    waits, works = MissionReport(), MissionReport("command")
    orders = restarted(waits, works, states=("idle", "done"), commands=[(50, "start", KITCHEN)])
    assert [order.at_s for order in orders] == [50]


def restarted(*missions, states=("done",), commands=()):
    """Return the chapters of a recording with a status of each mission, of 5 in 60 cells."""
    statuses = [
        StatusSample(at_s, Status(state=state, mission=mission, coverage=CoverageReport(60, 5)))
        for at_s, state, mission in zip((0.0, 60.0), states, missions, strict=False)
    ]
    spans = spans_of([(each.at_s, each.status.state, "") for each in statuses], 100.0)
    return chapters(RunData(statuses=statuses, commands=received(commands)), spans, 100.0)


def test_an_equal_order_continues_unless_it_is_over():
    rows = ((0, "idle", 0, 60), (11, "covering", 5, 60), (50, "done", 60, 60))
    twice = [(10, "start", ALL), (20, "start", ALL)]
    assert [order.at_s for order in told(*rows, commands=twice)] == [10]
    anew = [(10, "start", ALL), (60, "start", ALL)]
    assert [order.at_s for order in told(*rows, commands=anew)] == [10, 60]


def test_an_order_for_everything_continues_one_begun_by_itself():
    own = MissionReport("itself")
    for commands, starts in (([(50, "start", ALL)], [0]), ([(50, "start", KITCHEN)], [0, 50])):
        orders = restarted(own, own, states=("covering", "covering"), commands=commands)
        assert [order.at_s for order in orders] == starts


@pytest.mark.parametrize("command", ["cancel", "reset"])
def test_a_cancelled_order_is_over(command):
    rows = ((0, "covering", 5, 60), (20.1, "idle", 0, 60), (30.1, "covering", 0, 60))
    commands = [(20, command, ALL), (30, "start", ALL), (90, command, ALL)]
    orders = told(*rows, commands=commands)
    assert [(o.at_s, o.until_s, o.ended_by) for o in orders] == [
        (0.0, 20, command),
        (30, 90, command),
    ]
    assert [order.complete for order in orders] == [False, False]
    document = ReviewDocument(complete=False, state="idle", orders=orders[:1])
    said = f"not complete: ended by the command {command} at 0:20.0"
    assert verdicts(document) == [(False, said)]


def test_an_order_that_was_done_is_not_ended_by_a_later_command():
    (order,) = told(
        (0, "covering", 0, 9),
        (10, "done", 8, 9),
        (21, "idle", 8, 9),
        commands=[(20, "cancel", ALL)],
    )
    document = ReviewDocument(complete=order.complete, state="idle", orders=[order])
    said = "not complete: the mission was done with 8 of 9 cells covered"
    assert verdicts(document) == [(False, said)]


def test_a_command_names_what_it_changes():
    rug = KeepOut("rug", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    commands = [
        Command("pause"),
        Command("keep_out_add", keep_out=rug),
        Command("room_name", room=RoomRequest(4, "hall")),
    ]
    data = RunData(commands=[(1.0, command) for command in commands])
    assert [each.command for each in commands_of(data)] == [
        "pause",
        "keep_out_add rug",
        "room_name 4",
    ]


ORDER = OrderChapter("itself", 0.0, 100.0, None, "done", True, 400, 400)


def run(config=(), **changes):
    settings = {"robot.tool_width_m": 0.3, "planner.line": "thorough", "robot.overlap": 0.1}
    settings |= {"bus.connect": "tcp/127.0.0.1:1"}
    base = {
        "robot": "maja",
        "version": "1.0",
        "config": settings | dict(config),
        "map": MapSize(rows=100, cols=200, resolution_m=0.05),
        "orders": [ORDER],
        "driven_m": 3.0,
        "faults": 2,
    }
    return ReviewDocument(**base | changes)


@pytest.mark.parametrize(
    ("other", "what", "compares"),
    [
        (run(), [], True),
        (run(version="2.0", config={"planner.line": "quick"}), ["version", "planner.line"], False),
        (run(version="2.0"), ["version"], True),
        (run(version=None), [], True),
        (run(config={"robot.tool_width_m": 0.5}), ["robot.tool_width_m"], False),
        (run(config={"robot.overlap": 0.0}), ["robot.overlap"], False),
        (run(map=MapSize(rows=100, cols=210, resolution_m=0.05)), [], True),
        (run(map=MapSize(rows=100, cols=300, resolution_m=0.05)), ["building"], False),
        (run(orders=[ORDER, ORDER]), ["orders"], False),
        (run(config={"bus.connect": "tcp/127.0.0.1:2"}), [], True),
    ],
)
def test_differing_setups_are_listed(other, what, compares):
    both = side_by_side(run(), other)
    assert [difference["what"] for difference in both["setup"]] == what
    assert both["compare"] is compares
    words = setup_words(setup_differences(run(), other))
    assert ("cannot be compared" in words) is not compares


def test_long_values_of_differing_settings_are_cut(capsys):
    mask = {letter: f"inline:{letter * 9000}" for letter in "AB"}
    print_comparison(*(run(config={"mission.keep_out_mask": mask[letter]}) for letter in mask))
    text = capsys.readouterr().out
    assert "mission.keep_out_mask" in text
    assert text.count("A") < 200 > text.count("B")


def test_numbers_have_a_difference():
    one, other = run(), run(driven_m=1.5, faults=2, paths=4, duration_s=112.5)
    rows = {name: less for name, _, _, less in compared_rows(one, other)}
    assert (rows["driven"], rows["messages refused"], rows["paths published"]) == (
        "+1.5",
        "0",
        "-4",
    )
    assert rows["complete"] == ""
    # A time has the form of the times beside it.
    assert rows["duration"] == "-1:52.5"


@pytest.mark.parametrize(
    ("members", "words"),
    [
        # Cells alone read as if all the floor were swept.
        ({"complete": True, "swept_m2": 47.7, "reachable_m2": 49.4},
         "complete: every cell covered; 47.7 of 49.4 m2 (96.6 %) of floor swept"),
        ({"complete": False, "state": "done", "covered_cells": 549, "coverable_cells": 550},
         "not complete: the mission was done with 549 of 550 cells covered"),
    ],
)  # fmt: skip
def test_one_order_has_a_verdict_in_words(members, words):
    assert verdicts(ReviewDocument(**members)) == [(members["complete"], words)]
