"""The table of all states of a robot: a row each, from which sets, colours and words are made."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Literal, Self


class Activity(IntEnum):
    """What a robot does in a state, from least to most.

    Attributes:
        NONE: no order is under way; the robot may be switched off.
        STARTING: the mission waits for its first map or pose, or for kernels.
        CHARGING: the robot charges.
        HELD: people have stopped it.
        STUCK: it has work, and cannot continue.
        DRIVING: it drives without covering.
        COVERING: it covers floor, or waits for the path to do so.
    """

    NONE, STARTING, CHARGING, HELD, STUCK, DRIVING, COVERING = range(7)


Colour = Literal["grey", "violet", "green", "cyan", "blue", "amber", "red"]


@dataclass(frozen=True, slots=True)
class Row:
    """Properties of a state.

    Attributes:
        activity: what the robot does.
        colour: colour of the state, of which each output has its own shade.
        level: its level of ROS diagnostics: 0 OK, 1 WARN, 2 ERROR.
        needs_help: whether people have to help.
        word: one word for the owner of the robot; "" if the state's own name is plain.
        does: what the robot does, for its owner; "" if that depends on more than the state.
    """

    activity: Activity
    colour: Colour
    level: int = 0
    needs_help: bool = False
    word: str = ""
    does: str = ""


class State(StrEnum):
    """State of a robot; the value is its name in messages.

    Attributes:
        IDLE: there is no order.
        WAITING_FOR_MAP: no map has arrived yet.
        WAITING_FOR_POSE: no pose has arrived yet.
        LOADING: kernels are loaded with the first map.
        PLANNING: the robot waits for its first path.
        COVERING: the robot has a path to cover floor.
        RETURNING: the robot has a path home.
        CHARGING: the robot stands where it charges; `reason` says at what level it goes on.
        PAUSED: by command; what the robot passes over still counts as covered.
        BLOCKED: it cannot continue: it is in an occupied cell, on unknown ground or in a keep-out
            zone; there is no way home, or to the dock; near the dock no battery message has come
            yet that shows whether the battery charges; no plan can be made on this map; another
            daemon of this name plans; or unreached cells are tried again after a while. `reason`
            says what it waits for.
        DEGRADED: the robot drives with a trouble, whose text is the `reason`. The path is kept;
            without poses nothing counts as covered. The state ends by itself.
        DONE: the order is completed, as far as possible; see `mission.unreached`.
    """

    row: Row

    def __new__(cls, name: str, row: Row) -> Self:
        """Return the state ``name`` with its properties."""
        state = str.__new__(cls, name)
        state._value_, state.row = name, row
        return state

    IDLE = "idle", Row(Activity.NONE, "grey", word="ready", does="Ready to sweep")
    WAITING_FOR_MAP = (
        "waiting for map",
        Row(Activity.STARTING, "grey", 1, word="starting", does="Waits for its map of the rooms"),
    )
    WAITING_FOR_POSE = (
        "waiting for pose",
        Row(Activity.STARTING, "grey", 1, word="starting", does="Finds out where it is"),
    )
    LOADING = "loading", Row(Activity.STARTING, "grey", word="starting", does="Starts up")
    PLANNING = "planning", Row(Activity.COVERING, "violet", does="Plans its way")
    COVERING = "covering", Row(Activity.COVERING, "green", word="sweeping")
    RETURNING = "returning", Row(Activity.DRIVING, "green", word="driving home")
    CHARGING = "charging", Row(Activity.CHARGING, "cyan")
    PAUSED = "paused", Row(Activity.HELD, "amber", 1)
    BLOCKED = (
        "blocked",
        Row(Activity.STUCK, "red", 2, True, word="waiting", does="Cannot go on just now"),
    )
    DEGRADED = "degraded", Row(Activity.COVERING, "amber", 1, True, word="needs help")
    DONE = "done", Row(Activity.NONE, "blue", does="Done")

    @property
    def is_at_rest(self) -> bool:
        """Whether the robot stands, and no path is published."""
        return self.row.activity < Activity.DRIVING


_ROWS = {state.value: state.row for state in State}


def row_of(name: str) -> Row:
    """Return the properties of a state by its name; those of no activity for an unknown one."""
    return _ROWS.get(name, Row(Activity.NONE, "grey"))


def states_of(least: Activity, most: Activity = Activity.COVERING) -> frozenset[State]:
    """Return the states with activities from ``least`` to ``most``."""
    return frozenset(state for state in State if least <= state.row.activity <= most)


TROUBLED = frozenset(state for state in State if state.row.needs_help)
"""States in which people have to help."""
AT_WORK = states_of(Activity.COVERING)
"""States in which the robot covers floor, or soon will."""
