"""A unit of deploy/ in a lab: installed, configured, watched, and taken away again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from tests.deploy.lab import Lab

UNITS = Path(__file__).parents[2] / "deploy"
CONFIG = "/etc/fasaco-edge/config.yaml"
QUIET = {"mission": {"lost_pose_s": 0.0}, "planner": {"spare_share": 0.0}}


class Service:
    """One unit, and what systemd and the journal say of it.

    Args:
        lab: where it is installed.
        name: of the unit.
        text: the unit; by default that of ``deploy`` by this name.
    """

    def __init__(self, lab: Lab, name: str = "fasaco-edge", text: str = "") -> None:
        self.lab = lab
        self.name = name
        text = text or (UNITS / f"{name}.service").read_text()
        lab.write(f"/etc/systemd/system/{name}.service", text)
        self._cursor = ""
        self._cursor = self._newest()
        self.configure()
        self.reload_units()

    def configure(self, text: str | None = None, **sections: Any) -> None:
        """Write the configuration: these sections, or a text."""
        self.lab.write(CONFIG, yaml.safe_dump(QUIET | sections) if text is None else text)

    def drop_in(self, name: str, text: str) -> None:
        self.lab.write(f"/etc/systemd/system/{self.name}.service.d/{name}.conf", text)
        self.reload_units()

    def reload_units(self) -> None:
        self.lab.run("systemctl", "daemon-reload")

    def start(self, *, fails: bool = False) -> float:
        """Start it; return the seconds until it was ready."""
        started = time.monotonic()
        done = self.lab.run("systemctl", "start", self.name, check=False, timeout_s=600.0)
        seconds = time.monotonic() - started
        assert (done.returncode != 0) is fails, f"{done.stderr}\n{self.text()}"
        return seconds

    def stop(self) -> float:
        """Stop it; return the seconds until it was gone."""
        started = time.monotonic()
        self.lab.run("systemctl", "stop", self.name)
        return time.monotonic() - started

    def remove(self) -> None:
        """Stop it and take away all that it left."""
        self.lab.run("systemctl", "stop", self.name, check=False)
        self.lab.run("systemctl", "reset-failed", self.name, check=False)
        kept = f"/etc/systemd/system/{self.name}.service.d /var/lib/private/{self.name}"
        self.lab.run("sh", "-c", f"rm -rf {kept} /var/log/private/{self.name}/*")
        self.reload_units()

    def show(self, name: str) -> str:
        return self.lab.run("systemctl", "show", "-P", name, self.name).stdout.strip()

    @property
    def pid(self) -> int:
        """Its main process, as the lab counts; 0 for none."""
        return int(self.show("MainPID"))

    def signal(self, name: str) -> None:
        self.lab.run("kill", f"-{name}", str(self.pid))

    def journal(self) -> list[dict[str, Any]]:
        """Return its own entries in the journal since it was made, the fields of each."""
        self.lab.run("journalctl", "--sync")
        words = ["journalctl", "-o", "json", "--all", f"--unit={self.name}"]
        words += [f"--after-cursor={self._cursor}"] if self._cursor else []
        entries = [json.loads(line) for line in self.lab.run(*words).stdout.splitlines()]
        return [entry for entry in entries if entry.get("_PID") != "1"]

    def text(self) -> str:
        """Return what it and systemd have said, as lines."""
        self.lab.run("journalctl", "--sync")
        words = ["journalctl", "-o", "cat", f"--unit={self.name}"]
        words += [f"--after-cursor={self._cursor}"] if self._cursor else []
        return self.lab.run(*words).stdout

    def ask(self, name: str = "status") -> dict[str, Any]:
        done = self.lab.run("fasaco-edge", "ask", name, "--json")
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer

    def _newest(self) -> str:
        said = self.lab.run("journalctl", "-n", "0", "--show-cursor").stdout
        return said.rpartition("-- cursor: ")[2].strip()


# A busy machine, or four tests at a time on a third of a core, may take so many times as long.
PATIENCE = 20.0


def wait_for(condition: Callable[[], object], seconds: float, what: str) -> float:
    """Wait until a condition holds, as a rule within so long [s]; return the seconds that took."""
    started = time.monotonic()
    while not condition():
        waited = time.monotonic() - started
        assert waited < PATIENCE * seconds, f"not within {waited:g} s: {what}"
        time.sleep(0.05)
    return time.monotonic() - started
