"""Findings of a check, and its context."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.doctor.unit import Unit


class Level(StrEnum):
    """Severity of a finding."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the doctor's report.

    Attributes:
        level: its severity.
        found: the finding in words.
        to_do: what to do about it, or "".
        details: more lines, shown on request.
    """

    level: Level
    found: str
    to_do: str = ""
    details: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CheckContext:
    """The inputs of checks.

    Attributes:
        config: the daemon's configuration.
        file: file of the configuration; None for the defaults.
        unit: the daemon's systemd unit; None if there is none.
        recordings: folder for recordings, if one is given.
        root: root of the computer's file system.
    """

    config: DaemonConfig
    file: Path | None = None
    unit: Unit | None = None
    recordings: Path | None = None
    root: Path = Path("/")

    @property
    def environ(self) -> Mapping[str, str]:
        """The environment of the daemon: its unit's, or else that of this process."""
        return self.unit.environ if self.unit else os.environ


@dataclass(frozen=True, slots=True)
class Check:
    """A check of a daemon and its computer.

    Attributes:
        name: its name, one or two words.
        look: runs the check, which changes nothing.
        of_machine: whether it also runs without a configuration.
    """

    name: str
    look: Callable[[CheckContext], Finding]
    of_machine: bool = False


def ok(found: str, details: Iterable[str] = ()) -> Finding:
    """Return a finding without a fault."""
    return Finding(Level.OK, found, "", tuple(details))


def warn(found: str, to_do: str, details: Iterable[str] = ()) -> Finding:
    """Return a finding that deserves attention, although the daemon works."""
    return Finding(Level.WARN, found, to_do, tuple(details))


def fail(found: str, to_do: str, details: Iterable[str] = ()) -> Finding:
    """Return a finding that must be fixed."""
    return Finding(Level.FAIL, found, to_do, tuple(details))


def worst(findings: Sequence[Finding]) -> Finding:
    """Return the first finding of the worst level."""
    return max(findings, key=lambda finding: list(Level).index(finding.level))
