"""What is left of a person's intent after each command, in each state."""

from dataclasses import replace

import pytest

from fasaco_edge.errors import CommandError
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.order import Command, read_order
from fasaco_edge.mission.work.order_state import AT_HOME, NO_ORDER, OrderState, Stage

SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]
A = read_order({"zones": [{"name": "a", "polygon": SQUARE}], "passes": 3, "return_home": True})
B = read_order({"passes": 2})
VASE = KeepOut("vase", ((0.5, 0.5), (1.0, 0.5), (1.0, 1.0)))

SECOND = OrderState(A, pass_number=2, begun=True, home=(3, 4), keep_out=(VASE,))
IDLE = replace(OrderState.idle(NO_ORDER), home=(3, 4), keep_out=(VASE,))
OVER = replace(SECOND, stage=Stage.OVER)
STATES = {
    "no order": IDLE,
    "no order, drives home": replace(IDLE, errand="home"),
    "no order, drives home, paused": replace(IDLE, errand="home", paused=True),
    "a": SECOND,
    "a, paused": replace(SECOND, paused=True),
    "a, drives home": replace(SECOND, errand="home"),
    "a, drives home, paused": replace(SECOND, errand="home", paused=True),
    "a, paused at home": replace(SECOND, paused=True, why=AT_HOME),
    "a, charges": replace(SECOND, errand="charge"),
    "a, charges, paused": replace(SECOND, errand="charge", paused=True),
    "a, returns": replace(SECOND, stage=Stage.RETURNING),
    "a, returns, paused": replace(SECOND, stage=Stage.RETURNING, paused=True),
    "a, over": OVER,
    "a, over, drives home": replace(OVER, errand="home"),
    "a, over, drives home, paused": replace(OVER, errand="home", paused=True),
    "a, over, charges": replace(OVER, errand="charge"),
}
COMMANDS = {
    "same": Command("start", A),
    "other": Command("start", B),
    **{name: Command(name) for name in ("pause", "resume", "home", "cancel", "reset")},
}
# The state before, and after each command; "=" is the same, "-" is refused. "again" is the same
# order from its beginning.
TABLE = """
before                        | same       | other      | pause                         | resume                | home                  | cancel   | reset
no order                      | again      | b          | -                             | -                     | no order, drives home | =        | no order
no order, drives home         | again      | b          | no order, drives home, paused | =                     | =                     | no order | no order
no order, drives home, paused | again      | b          | =                             | no order, drives home | no order, drives home | no order | no order
a                             | =          | b          | a, paused                     | =                     | a, drives home        | no order | no order
a, paused                     | a          | b          | =                             | a                     | a, drives home        | no order | no order
a, drives home                | a          | b          | a, drives home, paused        | =                     | =                     | no order | no order
a, drives home, paused        | a          | b          | =                             | a, drives home        | a, drives home        | no order | no order
a, paused at home             | a          | b          | =                             | a                     | a, drives home        | no order | no order
a, charges                    | =          | b, charges | a, charges, paused            | =                     | a, drives home        | no order | no order
a, charges, paused            | a, charges | b, charges | =                             | a, charges            | a, drives home        | no order | no order
a, returns                    | =          | b          | a, returns, paused            | =                     | a, returns, home      | no order | no order
a, returns, paused            | a, returns | b          | =                             | a, returns            | a, returns, home      | no order | no order
a, over                       | again      | b          | -                             | -                     | a, over, drives home  | no order | no order
a, over, drives home          | again      | b          | a, over, drives home, paused  | =                     | =                     | no order | no order
a, over, drives home, paused  | again      | b          | =                             | a, over, drives home  | a, over, drives home  | no order | no order
a, over, charges              | again, charges | b, charges | a, over, charges, paused   | =                     | a, over, drives home  | no order | no order
"""  # noqa: E501
AFTER = STATES | {
    "again": OrderState(A, home=(3, 4), keep_out=(VASE,)),
    "again, charges": OrderState(A, errand="charge", home=(3, 4), keep_out=(VASE,)),
    "b": OrderState(B, home=(3, 4), keep_out=(VASE,)),
    "b, charges": OrderState(B, errand="charge", home=(3, 4), keep_out=(VASE,)),
    "a, returns, home": replace(SECOND, stage=Stage.RETURNING, errand="home"),
    "a, over, charges, paused": replace(OVER, errand="charge", paused=True),
}


def rows():
    head, *lines = [[cell.strip() for cell in line.split("|")] for line in TABLE.split("\n")[1:-1]]
    return [
        pytest.param(before, name, cell, id=f"{before}: {name}")
        for before, *cells in lines
        for name, cell in zip(head[1:], cells, strict=True)
    ]


def test_the_table_has_every_state_and_command():
    told = {(param.values[0], param.values[1]) for param in rows()}
    assert told == {(state, command) for state in STATES for command in COMMANDS}


@pytest.mark.parametrize(("before", "name", "expected"), rows())
def test_every_command_in_every_state(before, name, expected):
    state = STATES[before]
    if expected == "-":
        with pytest.raises(CommandError):
            state.commanded(COMMANDS[name])
        return
    after = state.commanded(COMMANDS[name])
    wanted = state if expected == "=" else AFTER[expected]
    # Of being without an order only the reason differs.
    assert replace(after, why="") == replace(wanted, why="", home=after.home)
    assert after.home == (None if name == "reset" else (3, 4))
    assert after.keep_out == (VASE,)
    # Kept on disk it is the same.
    assert OrderState.from_json(after.to_json()) == after


@pytest.mark.parametrize("state", STATES.values(), ids=STATES)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_given_twice_is_given_once(state, name):
    try:
        once = state.commanded(COMMANDS[name])
        twice = once.commanded(COMMANDS[name])
    except CommandError:
        return
    assert twice == once


def test_a_robot_sent_home_sweeps_no_other_building_instead():
    sent = replace(OrderState.autostart(), errand="home", home=(3, 4), keep_out=(VASE,))
    for after in (sent.in_other_building("moved"), sent.in_other_frame("moved")):
        assert (after.automatic, after.paused, after.home, after.keep_out) == (True, True, None, ())
    idle = replace(IDLE, errand="home").in_other_building("moved")
    assert (idle.errand, idle.home, idle.keep_out) == ("", None, ())


def test_time_spent_counts_in_another_frame_too():
    begun = OrderState(read_order({"until_min": 5.0}), begun=True, spent_s=120.0)
    assert begun.in_other_frame("moved").spent_s == 120.0
