"""Publishers and daemons that come and go leave nothing behind in a daemon and a recorder.

    python -m tests.campaigns.come_and_go --mappers 10000 --daemons 1000 [--hub daemon]

Takes an hour.

A router, a daemon and a recorder; or no router, and the daemon is the hub, as by default. Then
mappers, each a session that publishes a map and goes, one in 25 by kill -9; then other daemons: two
in three of the same name, which wait, one of another; half of them end, half are killed. Before,
after the first fiftieth (what is loaded once is loaded then) and after the last it is counted what
daemon and recorder ask on the bus, and what they take: threads, descriptors, memory, and the share
of a core at rest. In the end the daemon itself is started again, one time for fifty others, and
only the recorder is looked at. An interrupt ends a phase, not the report. Exit code 1 where
something has grown.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import yaml
import zenoh

from fasaco_edge.bench.processes import warm_kernels
from fasaco_edge.bus.claim import ClaimState, claims_in
from fasaco_edge.host.processes import cpu_seconds, own_mb
from tests.campaigns import passing_mappers
from tests.campaigns.services import show
from tests.support.outsider import Outsider, open_client
from tests.support.processes import (
    ENVIRONMENT,
    PROGRAM,
    Daemon,
    daemon_process,
    free_endpoint,
)
from tests.support.rooms import map_bytes, pose_bytes, room
from tests.support.router import router_process

PREFIX = "fasaco/@v1/robot"
LATCHED = ("map", "status", "path", "coverage", "recorder")
# Mappers at a time, each in a process of its own.
PROCESSES = 2
PATIENCE_S = 120.0
# So much more may be there in the end; what is random in each, and no more.
MORE = {"questions_hz": 1.0, "threads": 4, "descriptors": 4, "cores": 0.03, "rss_mb": 5.0}
# What goes down when it is noticed that a program is gone; memory and processor's time do not.
SETTLES = ("questions_hz", "threads", "descriptors")
# Where others connect to a daemon itself, Zenoh takes threads at both ends, and keeps some for
# a while: a recorder has more of them just after that daemon has started again.
HUB_THREADS = 16
HUBS = ("router", "daemon")


@dataclass(frozen=True)
class Figures:
    """What a process takes at rest: threads, descriptors, share of a core, memory."""

    threads: int
    descriptors: int
    cores: float
    rss_mb: float


@dataclass(frozen=True)
class Row:
    """What was seen after a phase; ``recorder`` and ``daemon`` in its figures, by name."""

    after: str
    questions_hz: float
    took_s: float
    processes: dict[str, Figures]


@dataclass
class Campaign:
    """The house, whose hub everybody connects to, and what was seen in it."""

    hub: str
    is_daemon_hub: bool
    client: zenoh.Session
    processes: dict[str, int]
    rest_s: float
    say: Callable[[str], None]
    asked: Counter[str] = field(default_factory=Counter)
    rows: list[Row] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)

    def look(self, after: str, since: float) -> Row:
        """Look what is there once all is calm."""
        took_s = time.monotonic() - since
        time.sleep(self.rest_s / 2)
        self.asked.clear()
        before = {name: cpu_seconds(pid) for name, pid in self.processes.items()}
        time.sleep(self.rest_s)
        row = Row(
            after,
            self.asked.total() / self.rest_s,
            took_s,
            {
                name: Figures(
                    len(os.listdir(f"/proc/{pid}/task")),
                    len(os.listdir(f"/proc/{pid}/fd")),
                    (cpu_seconds(pid) - before[name]) / self.rest_s,
                    own_mb(pid),
                )
                for name, pid in self.processes.items()
            },
        )
        self.rows.append(row)
        self.say(_told(row))
        return row

    def compare(self, first: Row, after: str, since: float) -> None:
        """Look, and note what has grown since ``first`` and stays.

        On a busy machine what is gone is noticed late: it is looked again as long as that may be.
        """
        deadline = time.monotonic() + PATIENCE_S
        row = self.look(after, since)
        while self._may_settle(first, row) and time.monotonic() < deadline:
            self.rows.remove(row)
            row = self.look(after, since)
        self.violations += self._grown(first, row)

    def _may_settle(self, first: Row, last: Row) -> bool:
        return any(what in told for told in self._grown(first, last) for what in SETTLES)

    def _grown(self, first: Row, last: Row) -> list[str]:
        grown: list[tuple[str, float, float]] = []
        if last.questions_hz > first.questions_hz + MORE["questions_hz"]:
            grown.append(("questions_hz", first.questions_hz, last.questions_hz))
        for name in first.processes.keys() & last.processes.keys():
            was, is_now = asdict(first.processes[name]), asdict(last.processes[name])
            for what, value in is_now.items():
                is_hub = self.is_daemon_hub and what == "threads"
                if value > was[what] + (HUB_THREADS if is_hub else MORE[what]):
                    grown.append((f"{name}: {what}", was[what], value))
        return [
            f"after {last.after}: {what} from {was:.2f} to {is_now:.2f}"
            for what, was, is_now in grown
        ]

    def pass_mappers(self, count: int) -> None:
        """Let so many mappers come and go."""
        shares = [count // PROCESSES + (n < count % PROCESSES) for n in range(PROCESSES)]
        running: dict[int, subprocess.Popen[str]] = {}
        done = dict.fromkeys(range(PROCESSES), 0)
        command = [sys.executable, "-m", passing_mappers.__name__]
        try:
            while sum(done.values()) < count:
                for number, share in enumerate(shares):
                    left = share - done[number]
                    if number not in running and left:
                        begun = [*command, str(min(left, passing_mappers.KILLED)), self.hub]
                        running[number] = subprocess.Popen(
                            begun, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT
                        )
                for number, process in list(running.items()):
                    assert process.stdout is not None
                    if process.stdout.readline():
                        done[number] += 1
                    else:
                        process.communicate()
                        del running[number]
                if sum(done.values()) % passing_mappers.KILLED == 0:
                    show(f"{sum(done.values())} of {count} mappers")
        finally:
            for process in running.values():
                process.kill()
                process.communicate()

    def pass_daemons(self, folder: Path, count: int) -> None:
        """Let so many other daemons come and go."""
        for number in range(count):
            place = folder / f"other{number % 3}"
            place.mkdir(exist_ok=True)
            name = f"other{number}" if number % 3 == 2 else "robot"
            bus = {"mode": "client", "listen": [], "connect": [self.hub]}
            with daemon_process(place, bus=bus, robot={"name": name}) as daemon:
                self._await_claim(name, daemon)
                if number % 2:
                    daemon.kill()
            for file in (*place.glob("daemon*"), *place.glob("state/*")):
                file.unlink()
            show(f"{number + 1} of {count} daemons")

    def _await_claim(self, name: str, daemon: Daemon) -> None:
        """Wait until a daemon has found out whether it plans, and check that it is right."""
        deadline = time.monotonic() + PATIENCE_S
        is_second = name == "robot"
        word = "this one waits" if is_second else "ready after"
        while word not in daemon.log_text():
            if time.monotonic() > deadline or daemon.process.poll() is not None:
                self.violations.append(f"{name}: never said {word!r}: {daemon.log_text()[-300:]}")
                return
            time.sleep(0.02)
        planning = [own for own, stand in self.claims().items() if stand is ClaimState.PLANS]
        if is_second and len(planning) != 1:
            self.violations.append(f"{len(planning)} daemons of one name plan")

    def claims(self) -> dict[str, ClaimState]:
        """Return the daemons of the name there are."""
        replies = self.client.liveliness().get(f"{PREFIX}/claim/*/*", timeout=5.0)
        return claims_in(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)


def run_campaign(
    folder: Path,
    mappers: int,
    daemons: int,
    rest_s: float,
    hub: str = "router",
    say: Callable[[str], None] = print,
) -> Campaign:
    """Let so many come and go; return what was seen."""
    warm_kernels()
    router = free_endpoint()
    is_daemon_hub = hub == "daemon"
    bus: dict[str, Any] = {"mode": "client", "listen": [], "connect": [router]}
    if is_daemon_hub:
        bus = {"listen": [router]}
    with ExitStack() as stack:
        if not is_daemon_hub:
            stack.enter_context(router_process(router))
        daemon = stack.enter_context(_daemon(folder, bus))
        # It waits for the hub, which a recorder does not.
        client = open_client(router)
        stack.callback(client.close)
        recorder = stack.enter_context(_recorder(folder, router))
        processes = {"daemon": daemon.pid, "recorder": recorder.pid}
        campaign = Campaign(router, is_daemon_hub, client, processes, rest_s, say)
        spies = [
            client.declare_queryable(f"{PREFIX}/{topic}/@adv/**", _counting(campaign.asked, topic))
            for topic in LATCHED
        ]
        seat = stack.enter_context(Outsider(router))
        _cover(seat)
        began = time.monotonic()
        campaign.look("the start", began)
        first_mappers, first_daemons = max(mappers // 50, 4), max(daemons // 50, 1)
        campaign.pass_mappers(first_mappers)
        campaign.pass_daemons(folder, first_daemons)
        first = campaign.look(f"the first {first_mappers} mappers, {first_daemons} daemons", began)
        for what, count, let in (
            ("mappers", mappers - first_mappers, campaign.pass_mappers),
            ("daemons", daemons - first_daemons, lambda n: campaign.pass_daemons(folder, n)),
        ):
            began, told = time.monotonic(), f"{count} {what} more"
            try:
                let(count)
            except KeyboardInterrupt:
                told = f"an interrupt among {told}"
            campaign.compare(first, told, began)
        _check_works(campaign, seat)
        daemon.stop()
        del campaign.processes["daemon"]
        began, starts = time.monotonic(), max(daemons // 50, 1)
        try:
            for number in range(starts):
                with _daemon(folder, bus), Outsider(router) as fresh:
                    _cover(fresh)
                show(f"{number + 1} of {starts} starts of the daemon itself")
        except KeyboardInterrupt:
            pass
        campaign.compare(first, f"{starts} starts of the daemon itself", began)
        del spies
    return campaign


@contextmanager
def _daemon(folder: Path, bus: dict[str, Any]) -> Iterator[Daemon]:
    (folder / "daemon").mkdir(exist_ok=True)
    with daemon_process(folder / "daemon", executed=True, bus=dict(bus)) as daemon:
        yield daemon


@contextmanager
def _recorder(folder: Path, endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    # What it remembers of the part it writes goes with that; a look sees many.
    recording = {"part_min": 0.5}
    bus = {"mode": "client", "listen": [], "connect": [endpoint]}
    config = folder / "recorder.yaml"
    config.write_text(yaml.safe_dump({"bus": bus, "recording": recording}))
    (folder / "recordings").mkdir()
    command = [*PROGRAM, "record", "--config", str(config), "--out", str(folder / "recordings")]
    with (folder / "recorder.log").open("wb") as log:
        process = subprocess.Popen(command, stderr=log, env=ENVIRONMENT)
    try:
        yield process
        assert process.poll() is None, (folder / "recorder.log").read_text()[-2000:]
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def _cover(seat: Outsider) -> None:
    """Give map and pose until the robot has a path."""
    seat.put("map", map_bytes(room(4.0, 3.0)))
    seat.put("pose", pose_bytes(0.75, 0.75))
    seat.wait_status(lambda status: status["state"] == "covering")


def _check_works(campaign: Campaign, seat: Outsider) -> None:
    status = seat.ask_status()
    # No robot drives the path, so it stands.
    troubles = {trouble["code"] for trouble in status["troubles"]} - {"stands"}
    if status["mission"]["stage"] != "covering" or troubles or status["errors"]["total"]:
        campaign.violations.append(f"in the end {status['reason']}: {status['errors']}")
    stands = list(campaign.claims().values())
    if stands != [ClaimState.PLANS]:
        campaign.violations.append(f"claims in the end: {stands}")


def _counting(asked: Counter[str], topic: str) -> zenoh.handlers.Callback[zenoh.Query]:
    def count(query: zenoh.Query) -> None:
        asked[topic] += 1
        query.drop()  # type: ignore[no-untyped-call]

    return zenoh.handlers.Callback(count, indirect=False)


def _told(row: Row) -> str:
    told = [f"{row.after:36} {row.took_s:7.0f} s {row.questions_hz:6.1f} questions/s"]
    for name, f in row.processes.items():
        told.append(
            f"{name} {f.threads} threads {f.descriptors} fds {f.cores:.3f} cores {f.rss_mb:.1f} MB"
        )
    return "  ".join(told)


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mappers", type=int, default=10_000, help="(default: %(default)s)")
    parser.add_argument("--daemons", type=int, default=1_000, help="(default: %(default)s)")
    parser.add_argument("--hub", choices=HUBS, default=HUBS[0],
                        help="what all connect to (default: %(default)s)")  # fmt: skip
    parser.add_argument("--rest", type=float, default=10.0, metavar="S",
                        help="how long each look takes [s] (default: %(default)s)")  # fmt: skip
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="come-and-go-") as folder:
        campaign = run_campaign(Path(folder), args.mappers, args.daemons, args.rest, args.hub)
    for violation in campaign.violations:
        print(violation)
    print("nothing has grown" if not campaign.violations else "FAILED")
    return int(bool(campaign.violations))


if __name__ == "__main__":
    sys.exit(main())
