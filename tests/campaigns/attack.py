"""Attacks on a daemon in the middle of a mission, and how it fares.

    python -m tests.campaigns.attack

Takes minutes.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import zenoh

from fasaco_edge.host.processes import cpu_seconds, own_mb
from tests.campaigns.attacks import AT, GOOD_MAP, attacks, pour
from tests.support.outsider import Outsider, open_client
from tests.support.processes import Daemon, daemon_process
from tests.support.rooms import pose_bytes
from tests.support.secured import House, authority, secured_daemon, transport
from tests.support.waiting import meanwhile

# Before each attack the daemon's share of a core is looked at for so long [s].
QUIET_S = 2.0
# Of a shorter attack a share of a core would say nothing.
LEAST_S = 2.0
ASK_EVERY_S = 0.2


@dataclass
class Row:
    """What was tried, and what happened.

    Attributes:
        cpu_before, cpu_during: of the daemon [cores].
        slowest_answer_ms: of the status, asked for by an operator meanwhile.
        unharmed: state, path, pose and coverage stayed.
        works_after: how soon a good map and two poses were seen in the status, which comes once
            a second, afterwards [s]; None if not.
    """

    attack: str
    outcome: str
    cpu_before: float
    cpu_during: float
    slowest_answer_ms: float
    rss_mb: float
    unharmed: str
    works_after: float | None


class Boss(Outsider):
    """An operator who asks once more where Zenoh has thinned the questions."""

    def get(self, name: str, timeout_s: float = 5.0) -> list[zenoh.Reply]:
        """Ask; return all answers."""
        for _ in range(3):
            replies = super().get(name, timeout_s)
            if replies:
                break
            time.sleep(0.02)
        return replies


class Cores:
    """How much of a core a process takes."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._at, self._used_s = time.monotonic(), cpu_seconds(self._pid)

    def share(self) -> float:
        """Return its share of a core since the last call."""
        at, used_s = time.monotonic(), cpu_seconds(self._pid)
        share = (used_s - self._used_s) / (at - self._at)
        self._at, self._used_s = at, used_s
        return share


class Asking:
    """Asks for the status all the time, as an operator would, and notes the slowest answer."""

    def __init__(self, boss: Outsider) -> None:
        self.slowest_s = 0.0
        self._boss = boss

    def ask(self) -> None:
        """Ask once."""
        began = time.monotonic()
        answered = bool(self._boss.get("@rpc/status", timeout_s=5.0))
        took = time.monotonic() - began
        self.slowest_s = max(self.slowest_s, took if answered else float("inf"))


def begin(boss: Outsider, mapper: Any) -> None:
    """Begin a mission, and wait until it is quiet."""
    mapper.put("map", GOOD_MAP)
    mapper.put("pose", pose_bytes(*AT))
    boss.wait_status(lambda s: s["state"] == "covering" and not s["plan"]["planning"])


def mission(status: dict[str, Any]) -> dict[str, Any]:
    """Return what no attack may change."""
    kept = {key: status[key] for key in ("state", "coverage", "pose")}
    return kept | {"path": status["path"] and status["path"]["steps"]}


def harm(before: dict[str, Any], after: dict[str, Any]) -> str:
    """Return "yes" for unharmed, else what has changed."""
    then, now = mission(before), mission(after)
    changed = [f"{key}: {then[key]} -> {now[key]}" for key in then if then[key] != now[key]]
    return "; ".join(changed) or "yes"


def works(boss: Outsider, mapper: Any) -> float | None:
    """Give a map and poses as an honest mapper; return how soon they were taken [s]."""
    began, revision = time.monotonic(), boss.ask_status()["map"]["revision"]
    mapper.put("map", GOOD_MAP)
    taken = _until(boss, lambda status: status["map"]["revision"] > revision)
    for x, y in ((AT[0] + 0.1, AT[1]), AT):
        mapper.put("pose", pose_bytes(x, y))
        taken &= _until(boss, lambda status, x=x: abs(status["pose"]["x"] - x) < 1e-3)
    return time.monotonic() - began if taken else None


def _until(boss: Outsider, holds: Callable[[dict[str, Any]], bool]) -> bool:
    """Wait until the status is so; it is said once a second."""
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        if holds(boss.ask_status()):
            return True
        time.sleep(0.05)
    return False


def tried(
    title: str, attack: Callable[[], str], daemon: Daemon, boss: Outsider, mapper: Any
) -> Row:
    """Attack, and look at what comes of it."""
    cores = Cores(daemon.pid)
    time.sleep(QUIET_S)
    quiet, before = cores.share(), boss.ask_status()
    asking = Asking(boss)
    with meanwhile(asking.ask, ASK_EVERY_S):
        cores.share()
        began = time.monotonic()
        outcome = attack()
        time.sleep(max(0.0, began + LEAST_S - time.monotonic()))
        during = cores.share()
    assert daemon.process.poll() is None, daemon.log_text()
    time.sleep(0.5)
    now = boss.ask_status()
    counted = now["errors"]["total"] - before["errors"]["total"]
    if counted:
        outcome += f"; {counted} looked at and refused"
    unharmed, memory = harm(before, now), own_mb(daemon.pid)
    after = works(boss, mapper)
    return Row(title, outcome, quiet, during, 1e3 * asking.slowest_s, memory, unharmed, after)


def secured_rows(folder: Path, only: str) -> list[Row]:
    """Attack a daemon behind mutual TLS, with its limits as they are by default."""
    foreign = authority(folder / "foreign", "boss")
    rows = []
    with (
        secured_daemon(folder, security={"limits": {}}) as house,
        Boss(house.endpoint, transport=transport(house.ca.files("boss"))) as boss,
        house.sender("slam") as mapper,
    ):
        begin(boss, mapper)
        for title, attack in attacks(foreign).items():
            if only in title:
                rows.append(_row(title, attack, house, boss, mapper))
    return rows


def open_rows(folder: Path, only: str) -> list[Row]:
    """Flood a daemon on loopback, as it is without any configuration."""
    title = "loopback, no security: 1,000 maps/s of 1 MB"
    if only not in title:
        return []
    with daemon_process(folder, executed=True) as daemon, Outsider(daemon.endpoint) as boss:
        begin(boss, boss)
        session = open_client(daemon.endpoint)
        row = tried(
            title,
            lambda: pour(session, f"{boss.prefix}/map", GOOD_MAP, 1000.0),
            daemon,
            boss,
            boss,
        )
        session.close()  # type: ignore[no-untyped-call]
        _say(row)
        return [row]


def _row(
    title: str, attack: Callable[[House], str], house: House, boss: Outsider, mapper: Any
) -> Row:
    row = tried(title, lambda: attack(house), house.daemon, boss, mapper)
    _say(row)
    return row


def _say(row: Row) -> None:
    after = "NO" if row.works_after is None else f"{row.works_after:.2f} s"
    print(
        f"| {row.attack} | {row.outcome} | {row.cpu_before:.2f} | {row.cpu_during:.2f} "
        f"| {row.slowest_answer_ms:.0f} | {row.rss_mb:.0f} | {row.unharmed} | {after} |",
        flush=True,
    )


def main() -> None:
    """Try everything and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", metavar="WORDS", help="attacks with these words")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows there, too")
    args = parser.parse_args()
    print(
        "| tried | what happened | cores before | during | slowest answer [ms] | RSS [MB]", end=""
    )
    print(" | mission unharmed | good map and two poses after |\n|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        rows = secured_rows(Path(folder, "secured"), args.only)
        Path(folder, "open").mkdir()
        rows += open_rows(Path(folder, "open"), args.only)
    if args.json:
        args.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))


if __name__ == "__main__":
    main()
