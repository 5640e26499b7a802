"""A robot's computer on which nothing is installed, and the scripts that install and uninstall."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from tests.deploy import releases
from tests.deploy.lab import Lab, booted

PREFIX = "/opt/fasaco-edge"
CONFIG = "/etc/fasaco-edge/config.yaml"
HOME = "/srv/home"
# Where what is installed could leave something.
WATCHED = ("/etc", "/opt", "/usr/local/bin", "/var/lib", "/var/cache", "/var/log", HOME)
# systemd's own.
OTHERS = ("/var/lib/systemd", "/var/log/journal", "/var/lib/private ", "/etc/.pwd.lock")


# Compiled kernels and recordings.
GROWING = ("/var/cache/private/fasaco-edge", "/var/log/private/fasaco-edge")


class Robot(Lab):
    """A lab on which nothing is installed yet; releases lie in /srv, by version."""

    def install(self, version: str, *words: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        """Run a release's installer; its exit code has to be ``code``."""
        return self._run_installer(f"/srv/{version}/install.sh", *words, code=code)

    def roll_back(self) -> None:
        self._run_installer(f"{PREFIX}/current/deploy/install.sh", "--rollback", code=0)

    def _run_installer(self, *words: str, code: int) -> subprocess.CompletedProcess[str]:
        told = ("env", "SETTLE_S=1", f"HOME={HOME}", *words)
        done = self.run(*told, check=False, timeout_s=600.0)
        assert done.returncode == code, f"{done.returncode}\n{done.stdout}{done.stderr}"
        return done

    def uninstall(self, *words: str) -> str:
        """Uninstall by what is installed; return what it says."""
        script = f"{PREFIX}/current/deploy/uninstall.sh"
        return self.run("env", f"HOME={HOME}", script, *words).stdout

    def version(self, link: str = "current") -> str:
        return self.run("readlink", f"{PREFIX}/{link}").stdout.strip()

    def answers(self, version: str) -> bool:
        """Tell whether the service is up and of that version."""
        state = self.run("systemctl", "is-active", "fasaco-edge", check=False).stdout
        answer = self.run("fasaco-edge", "ask", "version", check=False).stdout
        return state == "active\n" and f"version: '{version}'" in answer

    def settled(self) -> dict[str, str]:
        """Return the files but those that come and go while it runs."""
        files = self.files().items()
        return {path: line for path, line in files if not path.startswith(GROWING)}

    def files(self) -> dict[str, str]:
        """Return every file of the folders watched: its kind, mode and, of a link, target."""
        found = self.run("find", *WATCHED, "-xdev", "-printf", r"%y %m %p %l\0").stdout
        lines = {line.split(" ", 2)[2]: line for line in found.split("\0") if line}
        return {path: line for path, line in lines.items() if not path.startswith(OTHERS)}


@contextmanager
def bare_robot(folder: Path, folders: Mapping[str, Path]) -> Iterator[Robot]:
    """Boot a lab that shows release folders.

    Kernels are compiled by what is installed there, unless ``installed.warm`` brings them.
    """
    shown = {f"/srv/{version}": release for version, release in folders.items()}
    with booted(folder, shown | releases.binds()) as lab:
        robot = Robot(lab.pid, lab.boot_s)
        # What this machine has of it already would be taken for ours.
        robot.run("rm", "-rf", "/etc/fasaco-edge")
        robot.run("mkdir", HOME)
        yield robot
