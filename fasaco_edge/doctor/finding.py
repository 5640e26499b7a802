"""Findings of a check, and its context: configuration, computer, the daemon's systemd unit."""

from __future__ import annotations

import os
import shlex
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from fasaco_edge.config.config import DaemonConfig

NAME = "fasaco-edge.service"
TIMEOUT_S = 1.0
PROPERTIES = (
    "LoadState", "ActiveState", "MainPID", "Environment", "MemoryMax", "MemoryHigh",
    "StateDirectory", "CacheDirectory", "DynamicUser", "User",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Unit:
    """The unit as systemd has loaded it, with drop-ins.

    Attributes:
        properties: properties that ``systemctl show`` prints.
    """

    properties: Mapping[str, str]

    @property
    def pid(self) -> int | None:
        """The daemon's process; None if it is not running."""
        return int(self.properties.get("MainPID", "0")) or None

    @property
    def environ(self) -> dict[str, str]:
        """The part of the daemon's environment that checks need."""
        words = shlex.split(self.properties.get("Environment", ""))
        environ = dict(word.partition("=")[::2] for word in words)
        if state := self.properties.get("StateDirectory", "").split():
            environ["STATE_DIRECTORY"] = f"/var/lib/{state[0]}"
        return environ

    def run_as(self, command: str) -> str:
        """Return the command line that runs a command as the daemon's user, with its folders."""
        dynamic = self.properties.get("DynamicUser") == "yes"
        user = self.properties.get("User") or (NAME.partition(".")[0] if dynamic else "")
        given = {
            "DynamicUser": "yes" if dynamic else "",
            "User": user,
            "CacheDirectory": self.properties.get("CacheDirectory", ""),
        }
        words = [f"-p {shlex.quote(f'{name}={value}')}" for name, value in given.items() if value]
        return " ".join(["systemd-run --wait", *words, command])

    def limit(self, name: str) -> int | None:
        """Return a limit [bytes]; None if it is not set."""
        value = self.properties.get(name, "infinity")
        return int(value) if value.isdecimal() else None


def find_unit(root: Path = Path("/")) -> Unit | None:
    """Return the unit; None if systemd does not run here, has no such unit, or does not answer."""
    if not (root / "run/systemd/system").is_dir():
        return None
    command = ["systemctl", "show", NAME, f"--property={','.join(PROPERTIES)}"]
    try:
        shown = subprocess.run(
            command, check=True, capture_output=True, text=True, timeout=TIMEOUT_S
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return None
    properties = dict(line.partition("=")[::2] for line in shown.splitlines())
    return Unit(properties) if properties.get("LoadState") == "loaded" else None


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
