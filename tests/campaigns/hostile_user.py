"""Every command as root, in folders that another user has prepared as traps.

    PYTHONPATH=deploy python -m tests.campaigns.hostile_user [--short]

Takes minutes.

Home, working folder, TMPDIR, PYTHONPATH and more lead into a trap (``tests.campaigns.trap``); the
mode mask is 0. Each of fasaco-edge's commands runs there as it is installed, with a daemon and a
recorder that keep their files in the trap; then dry runs of install.sh and uninstall.sh. Without
--short also a demo, and a plan for which all kernels are compiled. Nothing of the trap may be
loaded, or opened at all; no file of root's is written through a link, or open to everybody. Exit
code 1 on any violation.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from fasaco_edge.bench.processes import warm_kernels
from fasaco_edge.kernels.manifest import chosen_folder
from fasaco_edge.planners.compiling import compile_missing
from fasaco_edge.planners.stages import STAGES
from tests.campaigns.trap import Trap
from tests.deploy import installed, releases
from tests.support.processes import free_endpoint
from tests.support.waiting import until

PROGRAM = """\
#!{python} -I
from fasaco_edge.__main__ import program
program()
"""
TIMEOUT_S = 400.0


def why_not() -> str:
    """Return why this cannot be tried here, "" if it can."""
    return "" if os.geteuid() == 0 else "only root can be lured"


@dataclass
class Campaign:
    """A trap, what was run in it, and what came of that.

    Attributes:
        folder: of root's alone: what the commands write goes here.
        endpoint: where the daemon listens.
        slow: compile the kernels where no cache can be trusted, and run the demo.
    """

    folder: Path
    trap: Trap
    slow: bool
    say: Callable[[str], None]
    endpoint: str = field(default_factory=free_endpoint)
    counted: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        program = self.folder / "fasaco-edge"
        program.write_text(PROGRAM.format(python=sys.executable))
        program.chmod(0o755)
        self.program = str(program)
        self.own_cache = {"NUMBA_CACHE_DIR": str(kernel_folder().parent)}

    @contextmanager
    def judged(self, what: str) -> Iterator[None]:
        """Judge what is done in the block."""
        before = self.trap.state_of_secrets()
        with self.trap.watched() as opened:
            yield
        self.counted["runs"] += 1
        faults = {
            "loaded": sorted(set(self.trap.loaded())),
            "opened": sorted(map(str, opened)),
            "changed": self.trap.changed_secrets(before),
            "open to everybody": self.trap.open_to_all(self.folder),
        }
        found = [f"{what}: {name} {told}" for name, told in faults.items() if told]
        self.violations += found
        self.trap.mark.unlink(missing_ok=True)
        self.say(f"{what}: {'; '.join(found) or 'nothing'}")

    def run(self, *words: str, ends: tuple[int, ...] = (0,), cache: bool = True) -> None:
        """Run a command in the trap, and judge it; ``cache``: with one of its own for kernels."""
        with self.judged(" ".join(words[:3])):
            done = subprocess.run(
                [self.program, *words],
                cwd=self.trap.work,
                env=self.trap.environment | (self.own_cache if cache else {}),
                umask=0,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=TIMEOUT_S,
                check=False,
            )
        if done.returncode not in ends:
            said = (done.stdout + done.stderr)[-600:]
            self.violations.append(f"{words}: ended with {done.returncode}: {said}")

    @contextmanager
    def started(self, *words: str) -> Iterator[None]:
        """Run a command in the trap for as long as the block, and judge it."""
        log = self.folder / f"{words[0]}.log"
        with self.judged(f"{words[0]} for a while"), log.open("w") as out:
            process = subprocess.Popen(
                [self.program, *words],
                cwd=self.trap.work,
                env=self.trap.environment | self.own_cache,
                umask=0,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=out,
            )
            try:
                yield
                if process.poll() is not None:
                    told = log.read_text()[-600:]
                    self.violations.append(f"{words[0]}: ended with {process.poll()}: {told}")
            finally:
                process.send_signal(signal.SIGTERM)
                process.wait(TIMEOUT_S)


def try_alone(campaign: Campaign) -> None:
    """Run the commands that need nobody else."""
    out = campaign.folder
    campaign.run("--version")
    campaign.run("maps")
    campaign.run("warmup", "--check", ends=(0, 1), cache=False)
    campaign.run("doctor", "--json", ends=(0, 1), cache=False)
    campaign.run("warmup")
    config = out / "config.yaml"
    config.write_text(f"bus: {{listen: ['{campaign.endpoint}']}}\n")
    config.chmod(0o600)
    campaign.run("check-config", str(config), "--show")
    files = [f"--png={out}/plan.png", f"--path-out={out}/path.csv"]
    campaign.run("plan", "flat", "--budget", "0.2", "--json", *files)
    campaign.run("plan", "flat", "--budget", "0.2")
    if campaign.slow:
        campaign.run("plan", "flat", "--budget", "0.2", cache=False)
        campaign.run("bench", "speed", ends=(0, 1))
    # Where to is foreseen, and is a link of another user: it says so, and does nothing.
    campaign.run("demo", ends=(78,))
    if campaign.slow:
        campaign.run("demo", "--out", str(out / "demo"), "--json")


def try_together(campaign: Campaign) -> None:
    """Run the daemon with a recorder and a robot in the trap, and those who ask."""
    folder, connect = campaign.folder, ("--connect", campaign.endpoint)
    config, state = str(folder / "config.yaml"), str(campaign.trap.state)
    recordings = folder / "recordings"
    daemon = ("run", "--config", config, "--record", state, "--state", state)
    recorder = ("record", "--config", config, "--out", str(recordings))
    with campaign.started(*daemon):
        until(lambda: _asks(campaign, connect))
        with (
            campaign.started("simulate", "flat", "--speed", "10", *connect),
            campaign.started(*recorder),
        ):
            until(lambda: _bytes_in(campaign.trap.state) > 50_000)
            # A busy machine may take more than the seconds that they wait by themselves.
            asking = (*connect, "--timeout", "100")
            campaign.run("ask", "status", "--json", *asking)
            campaign.run("mission", "status", *asking)
            campaign.run("rooms", "list", *asking)
            campaign.run("watch", "--once", *asking)
            campaign.run("doctor", "--config", config, ends=(0, 1))
            until(lambda: _bytes_in(recordings) > 50_000)
    # In the home, where it is kept unless an option says otherwise, and what is there is links.
    with campaign.started("run", "--config", config):
        until(lambda: _asks(campaign, connect))
    recording = next(recordings.glob("*.rrd"))
    torn = folder / "torn.rrd"
    torn.write_bytes(recording.read_bytes()[:-7])
    told = [f"--png={folder}/a.png", "--json"]
    campaign.run("review", str(recording), *told)
    campaign.run("review", str(torn), ends=(0, 1))
    campaign.run("replay", str(recording), ends=(0, 1))


def _asks(campaign: Campaign, connect: tuple[str, ...]) -> bool:
    host, _, port = campaign.endpoint.removeprefix("tcp/").rpartition(":")
    with socket.socket() as probe:
        if probe.connect_ex((host, int(port))):
            return False
    words = [campaign.program, "ask", "status", *connect]
    return subprocess.run(words, capture_output=True, check=False).returncode == 0


def try_scripts_dry(campaign: Campaign) -> None:
    """Run install.sh and uninstall.sh where they change nothing."""
    release = releases.write_release(campaign.folder / "release", "1.0")
    environment = campaign.trap.environment
    _try_make(campaign)
    # A service runs on the system's Python, whose version may not be that of this release.
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    installs = [
        (release / "install.sh", "--dry-run", "--no-start"),
        # From a source tree, whose wheels would be downloaded.
        (installed.CHECKOUT / "deploy/install.sh", "--dry-run", "--no-start"),
    ]
    for words in (
        *(installs if Path("/usr/bin/python3").resolve().name == version else ()),
        (release / "uninstall.sh", "--dry-run"),
    ):
        with campaign.judged(f"{words[0].name} {' '.join(words[1:])}"):
            done = subprocess.run(
                list(map(str, words)),
                cwd=campaign.trap.work,
                env=environment,
                umask=0,
                capture_output=True,
                text=True,
                check=False,
            )
        if done.returncode:
            campaign.violations.append(f"{words}: {done.stderr}")


def _try_make(campaign: Campaign) -> None:
    """Run the README's first command, in a tree of one's own: there PYTHONPATH may say."""
    if shutil.which("make") is None or not (installed.CHECKOUT / ".venv/.installed").exists():
        return
    environment = campaign.trap.environment.items()
    make = ("make", "--directory", str(installed.CHECKOUT), "--assume-old=pyproject.toml")
    with campaign.judged("make demo"):
        done = subprocess.run(
            [*make, "demo", "ARGS=--help"],
            cwd=campaign.trap.work,
            env={name: value for name, value in environment if not name.startswith("PYTHON")},
            umask=0,
            capture_output=True,
            text=True,
            check=False,
        )
    if "fasaco-edge demo" not in done.stdout:
        campaign.violations.append(f"make demo: {done.stdout}{done.stderr}")


def _bytes_in(folder: Path) -> int:
    files = [path for path in folder.glob("*.rrd") if not path.is_symlink()]
    return sum(path.stat().st_size for path in files)


def kernel_folder() -> Path:
    """Return the folder of compiled kernels, with all of them in it."""
    compile_missing()
    folder, _ = chosen_folder(STAGES)
    assert folder is not None
    return folder


def run_campaign(folder: Path, say: Callable[[str], None], *, short: bool) -> Campaign:
    """Lure every command; ``short``: without the demo and a cold compiler."""
    place = folder / "trap"
    own = folder / "own"
    own.mkdir(mode=0o700)
    campaign = Campaign(own, Trap(place, kernel_folder()), not short, say)
    try_alone(campaign)
    try_together(campaign)
    try_scripts_dry(campaign)
    return campaign


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="what the tests run")
    args = parser.parse_args()
    if reason := why_not():
        print(reason)
        return 1
    warm_kernels()
    folder = Path(tempfile.mkdtemp(prefix="fasaco-hostile-"))
    folder.chmod(0o755)
    try:
        campaign = run_campaign(folder, lambda text: print(text, flush=True), short=args.short)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    for what, count in campaign.counted.items():
        print(f"{count:7}  {what}")
    print(f"{len(campaign.violations):7}  violations", *campaign.violations, sep="\n         ")
    return 1 if campaign.violations else 0


if __name__ == "__main__":
    sys.exit(main())
