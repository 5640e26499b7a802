"""What a check finds, and what it looks at."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from fasaco_edge.daemon.checks.unit import Unit
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
        file: where that was read; None for the defaults.
        unit: the daemon's unit, as systemd has it; None where there is none.
        recordings: where recordings are to go; None where nobody said.
        root: the computer's root folder.
    """

    config: DaemonConfig
    file: Path | None = None
    unit: Unit | None = None
    recordings: Path | None = None
    root: Path = Path("/")

    @property
    def environ(self) -> Mapping[str, str]:
        """The environment the daemon would find: its unit's, else ours."""
        return self.unit.environ if self.unit else os.environ


@dataclass(frozen=True, slots=True)
class Check:
    """A question about a daemon and its computer.

    Attributes:
        name: one or two words.
        look: finds the answer; it changes nothing.
        of_machine: whether it says something without a configuration, too.
    """

    name: str
    look: Callable[[Patient], Finding]
    of_machine: bool = False


def worst(levels: list[Level]) -> Level:
    """Return the worst level, ok for none."""
    return max(levels, key=list(Level).index, default=Level.OK)
