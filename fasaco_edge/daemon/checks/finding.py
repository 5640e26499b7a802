"""What a check finds, and what it looks at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from fasaco_edge.daemon.config import DaemonConfig


class Level(StrEnum):
    """How it is: good; good, but worth a thought; not to be left like that."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the doctor's report.

    Attributes:
        level: how it is.
        found: what was found.
        to_do: what to do about it; "" where there is nothing.
        details: more lines, for who wants to know.
    """

    level: Level
    found: str
    to_do: str = ""
    details: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Patient:
    """What checks look at; more may come to it.

    Attributes:
        config: the daemon's configuration.
        source: where that was read, for people.
    """

    config: DaemonConfig
    source: str


@dataclass(frozen=True, slots=True)
class Check:
    """A question about a daemon and its computer.

    Attributes:
        name: one or two words.
        look: finds the answer; it changes nothing, and raises nothing.
    """

    name: str
    look: Callable[[Patient], Finding]


def worst(levels: list[Level]) -> Level:
    """Return the worst level, ok for none."""
    return max(levels, key=list(Level).index, default=Level.OK)
