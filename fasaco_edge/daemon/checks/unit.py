"""What systemd says of the daemon's unit, where there are systemd and the unit."""

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
    "ControlGroup", "StateDirectory", "ProcSubset",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Unit:
    """The unit as systemd has loaded it, drop-ins included.

    Attributes:
        properties: of ``systemctl show``.
    """

    properties: Mapping[str, str]

    @property
    def pid(self) -> int | None:
        """The daemon's process; None where it does not run."""
        return int(self.properties.get("MainPID", "0")) or None

    @property
    def environ(self) -> dict[str, str]:
        """What the daemon finds in its environment, as far as that is for us."""
        words = shlex.split(self.properties.get("Environment", ""))
        environ = dict(word.partition("=")[::2] for word in words)
        if state := self.properties.get("StateDirectory", "").split():
            environ["STATE_DIRECTORY"] = f"/var/lib/{state[0]}"
        return environ

    def limit(self, name: str) -> int | None:
        """Return a limit [bytes]; None for none."""
        value = self.properties.get(name, "infinity")
        return int(value) if value.isdecimal() else None


def find_unit(root: Path = Path("/")) -> Unit | None:
    """Ask systemd; None where it is not at work here, knows no such unit, or does not answer."""
    if not (root / "run/systemd/system").is_dir():
        return None
    command = ["systemctl", "show", NAME, f"--property={','.join(PROPERTIES)}"]
    try:
        told = subprocess.run(
            command, check=True, capture_output=True, text=True, timeout=TIMEOUT_S
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return None
    properties = dict(line.partition("=")[::2] for line in told.splitlines())
    return Unit(properties) if properties.get("LoadState") == "loaded" else None
