"""Unit of the daemon's service, as systemd has loaded it."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

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
