"""Broken samples for a daemon in the middle of a mission.

    python -m tests.campaigns.fuzz_daemon --samples 10000

Takes minutes.
"""

from __future__ import annotations

import argparse
import json
import random
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from fasaco_edge.host.processes import own_mb
from tests.campaigns.map_mutations import mutant
from tests.support.outsider import Outsider
from tests.support.processes import Daemon, daemon_process
from tests.support.rooms import map_bytes, pillared_room, pose_bytes, two_rooms

# Fewer than the daemon holds between two turns of its loop: updates and poses must all be counted.
BATCH = 200
KINDS = ("map_update", "pose", "map")
# Of maps the newest displaces the one before: with a pause most are looked at.
PAUSE_S = {"map_update": 0.0, "pose": 0.0, "map": 0.002}


def run_campaign(daemon: Daemon, samples: int, seed: int = 0) -> dict[str, Any]:
    """Send so many broken samples during a mission; check that nothing came of them.

    Returns figures of the campaign. The mission begins with the first call.
    """
    rng, sent = random.Random(seed), Counter[str]()
    with Outsider(daemon.endpoint) as outsider:
        before = _begin(outsider)
        errors, counted = before["errors"]["total"], Counter[str]()
        resident = own_mb(daemon.pid)
        while sent.total() < samples:
            kind = KINDS[sent.total() // BATCH % len(KINDS)]
            batch = min(BATCH, samples - sent.total())
            for _ in range(batch):
                outsider.put(kind, mutant(rng, kind))
                time.sleep(PAUSE_S[kind])
            sent[kind] += batch
            after = _wait_counted(outsider, kind, errors, batch)
            counted[kind] += after["errors"]["total"] - errors
            errors = after["errors"]["total"]
            assert daemon.process.poll() is None, daemon.log_text()
            assert _mission(after) == _mission(before)
        codes = after["errors"]["by_code"]
        assert codes["malformed_message"] - _malformed(before) == counted.total()
        plans = after["plan"]["plans"]
        started = time.monotonic()
        outsider.put("map", map_bytes(two_rooms(door=True)))
        outsider.wait_status(lambda status: status["plan"]["plans"] == plans + 1)
        return {
            "sent": dict(sent),
            "counted": dict(counted),
            "by_code": codes,
            "next_map_to_status_ms": round(1e3 * (time.monotonic() - started)),
            "rss_mb_before": round(resident, 1),
            "rss_mb_after": round(own_mb(daemon.pid), 1),
        }


def _begin(outsider: Outsider) -> dict[str, Any]:
    status = outsider.ask_status()
    if status["state"] != "covering":
        outsider.put("map", map_bytes(pillared_room()))
        outsider.put("pose", pose_bytes(0.75, 0.75))
    return outsider.wait_status(
        lambda status: status["state"] == "covering" and not status["plan"]["planning"]
    )


def _wait_counted(outsider: Outsider, kind: str, errors: int, batch: int) -> dict[str, Any]:
    """Return the status that has counted a batch, or all of it that is looked at."""
    if kind != "map":
        return outsider.wait_status(lambda status: status["errors"]["total"] == errors + batch)
    seen = outsider.wait_status(lambda status: status["errors"]["total"] > errors)
    while (after := _next_status(outsider, seen))["errors"]["total"] != seen["errors"]["total"]:
        seen = after
    assert seen["errors"]["total"] <= errors + batch
    return seen


def _next_status(outsider: Outsider, seen: dict[str, Any]) -> dict[str, Any]:
    return outsider.wait_status(lambda status: status["uptime_s"] > seen["uptime_s"])


def _mission(status: dict[str, Any]) -> dict[str, Any]:
    return {
        key: status[key]
        for key in ("state", "reason", "map", "pose", "coverage", "path", "plan", "robot")
    }


def _malformed(status: dict[str, Any]) -> int:
    count: int = status["errors"]["by_code"].get("malformed_message", 0)
    return count


def main() -> None:
    """Run the campaign against a daemon of its own and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        daemon_process(Path(folder), executed=True) as daemon,
    ):
        print(json.dumps(run_campaign(daemon, args.samples, args.seed), indent=1))


if __name__ == "__main__":
    main()
