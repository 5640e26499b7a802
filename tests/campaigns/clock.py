"""Daemons and recorders whose clock is wrong, and is set while they run.

    python -m tests.campaigns.clock --boots 12 [--seed 0]

Takes minutes.

Each boot is a daemon with its recorder, started in 1970, a year off or right, and recorded into one
folder with a small quota; its clock then steps back and forth by years. Watched from outside, by a
clock that is right: which part is deleted, how long each recording claims to be, and every age that
status and `watch` show. Boots behind TLS begin in 1970: nobody gets in, doctor and log say why, and
once the clock is set the same process lets its guests in. Exit code 1 on any violation.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
import zenoh

from fasaco_edge.bench.processes import warm_kernels
from fasaco_edge.recording.write.quota import oldest_first
from tests.campaigns.shifted_clock import ShiftedClock
from tests.support.outsider import Outsider
from tests.support.processes import ENVIRONMENT, PROGRAM, Daemon, daemon_process, free_endpoint
from tests.support.recordings import read_summary
from tests.support.rooms import map_bytes, pose_bytes
from tests.support.secured import Authority, authority, transport
from tests.support.waiting import meanwhile, until

YEAR_S = 365 * 86_400.0
BOOT_1970_S = 12.0
QUOTA_MB = 2
# Room that a part takes which is begun when the quota is looked at, and the one that is written.
MOST_MB = QUOTA_MB + 3.0
# An age may be wrong by what it takes to ask.
SLACK_S = 3.0
RECORDING = {"part_mb": 1, "part_min": 0.03, "quota_mb": QUOTA_MB, "least_free_mb": 1}
AGE = re.compile(r"(?:up|written|silent for|gone for) ([\d.]+) (s|min|h)\b")
UNIT_S = {"s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass
class Campaign:
    """What was seen.

    Attributes:
        folder: an empty one.
        clock: of the processes that are looked at.
        created: the recordings' files in the order in which they appeared.
        violations: what must not be.
    """

    folder: Path
    clock: ShiftedClock
    hold_s: float
    created: list[str] = field(default_factory=list)
    counted: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)

    @property
    def runs(self) -> Path:
        """Where the recordings are."""
        return self.folder / "runs"

    def check(self, what: str, holds: bool, told: object = "") -> None:
        """Count a check, and note it where it does not hold."""
        self.counted[what] += 1
        if not holds:
            self.violations.append(f"{what}: {told}")

    def look(self) -> None:
        """Look at the recordings' folder: what is gone has to be older than what is there."""
        there = {path.name for path in self.runs.glob("*.rrd")}
        # Of one recorder, so that of two which came since the last look the numbers show.
        self.created += sorted(there - set(self.created), key=_part)
        first = next((i for i, name in enumerate(self.created) if name in there), 0)
        gone = [name for name in self.created if name not in there]
        newer = [name for name in self.created[first:] if name not in there]
        self.counted["parts deleted"] = len(gone)
        self.check("nothing newer is deleted", not newer, newer)

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Look at the folder all the time."""
        try:
            with meanwhile(self.look, 0.05):
                yield
        finally:
            self.look()

    def command(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run one of the commands by the shifted clock."""
        return subprocess.run(
            [*PROGRAM, *words],
            env=ENVIRONMENT | self.clock.environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )

    def check_ages(self, status: dict[str, Any], began: float) -> None:
        """Check every age of a status; ``began``: when the daemon did, monotonic [s]."""
        most_s = time.monotonic() - began + SLACK_S
        ages = {
            "uptime_s": status["uptime_s"],
            "ledger.age_s": status["ledger"]["age_s"],
            **{
                f"latency_ms.{name}": None if value is None else value / 1e3
                for name, value in status["latency_ms"].items()
            },
        }
        for name, age_s in ages.items():
            holds = age_s is None or 0.0 <= age_s <= most_s
            self.check("ages of the status", holds, f"{name} {age_s} s of {most_s:.0f} s")

    def check_view(self, told: str, began: float) -> None:
        """Check every age in what ``watch`` shows."""
        most_s = time.monotonic() - began + SLACK_S
        for number, unit in AGE.findall(told):
            age_s = float(number) * UNIT_S[unit]
            self.check("ages that watch shows", age_s <= 1.1 * most_s, f"{number} {unit}: {told}")
        # (A recorder that a busy machine holds up for ten seconds is silent, too, rightly.)
        taken_in = re.search("daemon is silent|silent for|gone for", told)
        self.check("watch is not taken in", taken_in is None, told)

    def check_parts(self, began: float) -> None:
        """Check what there is in the end."""
        self.look()
        ours = [path for path, _ in oldest_first(self.runs, "robot")]
        order = [name for name in self.created if (self.runs / name).exists()]
        self.check("the quota's order is the true one", [p.name for p in ours] == order, ours)
        size_mb = sum(path.stat().st_size for path in ours) / 1e6
        self.check("the quota holds", size_mb <= MOST_MB, f"{size_mb:.1f} MB")
        if early := [path for path in ours if "-1970" in path.name]:
            # The fullest: the last of a run may end before anything is in it.
            fullest = max(early, key=lambda path: path.stat().st_size)
            told = self.command("review", str(fullest))
            is_told = "was not set" in told.stdout
            self.check("review tells of a clock that was not set", is_told, told)
        most_s = time.monotonic() - began + SLACK_S
        for path in ours:
            length_s = read_summary(path).duration_s
            self.check(
                "lengths of recordings", 0.0 <= length_s <= most_s, f"{path.name} {length_s} s"
            )


def feeding(robot: Outsider) -> AbstractContextManager[None]:
    """Give the daemon maps that take room, and poses."""
    rng = np.random.default_rng(0)

    def feed() -> None:
        noise = rng.choice(np.array([0, 100, -1], np.int8), (400, 400))
        robot.put("map", map_bytes(noise))
        robot.put("pose", pose_bytes(5.0, 5.0))

    return meanwhile(feed, 0.2)


def boot(campaign: Campaign, shifts: list[float]) -> None:
    """Start a daemon with its recorder by one clock, and set that again and again."""
    clock, began = campaign.clock, time.monotonic()
    clock.shift(shifts[0])
    words = ("--record", str(campaign.runs))
    sections: dict[str, Any] = {"recording": RECORDING, "mission": {"autostart": False}}
    with (
        daemon_process(campaign.folder, *words, env=clock.environment, **sections) as daemon,
        Outsider(daemon.endpoint) as robot,
        watching(campaign, daemon) as view,
        feeding(robot),
        campaign.watched(),
    ):
        robot.wait_status(lambda s: (s["recorder"] or {}).get("state") == "recording")
        gone = campaign.counted["parts deleted"]
        for shift in shifts:
            before = len(campaign.created)
            clock.shift(shift)
            campaign.counted["steps of the clock"] += 1
            until(lambda before=before: len(campaign.created) > before, 30.0)
            time.sleep(campaign.hold_s)
            status = robot.ask_status()
            campaign.check_ages(status, began)
            restarts = status["recorder"]["restarts"]
            campaign.check("no recorder is started again", restarts == 0, status["recorder"])
        # By each of these clocks something has to go.
        until(lambda: campaign.counted["parts deleted"] > gone, 60.0)
        once = campaign.command("watch", "--once", "--connect", daemon.endpoint).stdout
        campaign.check_view(once, began)
        campaign.check("watch shows ages", "up " in once, once)
    campaign.check_view(view.read_text(), began)
    campaign.check_parts(began)
    campaign.counted["boots"] += 1


@contextmanager
def watching(campaign: Campaign, daemon: Daemon) -> Iterator[Path]:
    """Let ``watch`` run beside; yield the file that it writes its lines to."""
    file = campaign.folder / "watch.log"
    with file.open("w") as log:
        process = subprocess.Popen(
            [*PROGRAM, "watch", "--connect", daemon.endpoint],
            env=ENVIRONMENT | campaign.clock.environment,
            stdout=log,
            stderr=log,
        )
        try:
            yield file
        finally:
            process.terminate()
            process.wait()


def boot_secured(campaign: Campaign, ca: Authority) -> None:
    """Start a daemon behind TLS in 1970, knock, set the clock, and knock again."""
    clock, began = campaign.clock, time.monotonic()
    clock.shift(clock.to(BOOT_1970_S))
    endpoint = free_endpoint().replace("tcp/", "tls/")
    roles = {"operator": ["boss"], "recorder": ["robot"]}
    security = {"kind": "tls", "tls": ca.files("robot"), "roles": roles}
    bus = {"listen": [endpoint], "security": security}
    with daemon_process(campaign.folder, env=clock.environment, bus=bus) as daemon:
        until(lambda: "ready after" in daemon.log_text(), 60.0)
        said = "before the beginning of"
        campaign.check("the log says why", said in daemon.log_text(), daemon.log_text())
        config = campaign.folder / "secured.yaml"
        config.write_text(yaml.safe_dump({"bus": bus}))
        told = campaign.command("doctor", "--config", str(config)).stdout
        campaign.check("doctor says why", said in " ".join(told.split()), told)
        there = endpoint.replace("127.0.0.1", "localhost")
        shown = transport(ca.files("boss"))
        campaign.check("nobody gets in in 1970", not _gets_in(there, shown))
        away = {"mode": "client", "listen": [], "connect": [there], "security": security}
        config.write_text(yaml.safe_dump({"bus": away, "robot": {"name": "other"}}))
        state = str(campaign.folder / "other")
        ended = campaign.command("run", "--config", str(config), "--state", state)
        holds = ended.returncode == 1 and said in ended.stderr
        campaign.check("a client ends so that it is started again", holds, ended)
        clock.shift(0.0)
        with Outsider(there, transport=shown) as boss:
            campaign.check_ages(boss.ask_status(), began)
        campaign.check("the same process goes on", daemon.process.poll() is None)
        clock.shift(YEAR_S)
        campaign.check("nor a year later", not _gets_in(there, shown))
    campaign.counted["boots behind TLS"] += 1


def _gets_in(endpoint: str, shown: dict[str, Any]) -> bool:
    own = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": 0},
        "scouting": {"multicast": {"enabled": False}},
        "transport": shown,
    }
    with suppress(zenoh.ZError):
        session: Any = zenoh.open(zenoh.Config.from_json5(json.dumps(own)))
        found = list(session.liveliness().get("fasaco/@v1/robot/alive", timeout=1.0))
        session.close()
        return any(reply.ok is not None for reply in found)
    return False


def _part(name: str) -> tuple[str, int]:
    run, _, number = name.removesuffix(".rrd").rpartition("-part")
    return run, int(number)


def run_campaign(
    folder: Path, boots: int, seed: int, hold_s: float, say: Callable[[str], None]
) -> Campaign:
    """Boot so often; the first boots are one of each kind, the others are drawn."""
    rng = random.Random(seed)
    campaign = Campaign(folder, ShiftedClock(folder), hold_s)
    campaign.runs.mkdir()
    ca = authority(folder / "ca", "robot", "boss")
    in_1970 = campaign.clock.to(BOOT_1970_S)
    kinds = [0.0, in_1970, -YEAR_S, YEAR_S, -3600.0]
    plans = [[0.0, -YEAR_S], [in_1970, 0.0]]
    plans += [rng.choices(kinds, k=rng.randint(2, 4)) for _ in range(boots)]
    for number, shifts in enumerate(plans[:boots], start=1):
        boot(campaign, shifts)
        days = ", ".join(f"{shift / 86_400:+.0f}" for shift in shifts)
        say(f"boot {number} of {boots}: clock off by {days} days")
        if number % 4 == 1:
            boot_secured(campaign, ca)
            say("and one behind TLS")
    return campaign


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--boots", type=int, default=12, help="daemons (default: %(default)s)")
    parser.add_argument("--hold", type=float, default=4.0, help="with each clock [s]")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    warm_kernels()
    with tempfile.TemporaryDirectory() as folder:
        campaign = run_campaign(
            Path(folder), args.boots, args.seed, args.hold, lambda text: print(text, flush=True)
        )
    for what, count in campaign.counted.items():
        print(f"{count:7}  {what}")
    print(f"{len(campaign.violations):7}  violations", *campaign.violations, sep="\n         ")
    return 1 if campaign.violations else 0


if __name__ == "__main__":
    sys.exit(main())
