"""Follower and look-alike of Nav2 as processes of their own, for tests and the campaign."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from tests.support.processes import ENVIRONMENT, PROGRAM

Point = tuple[float, float]


class Robot:
    def __init__(self, **wanted: Any) -> None:
        words = [sys.executable, "-m", "tests.support.nav2_robot", json.dumps(wanted)]
        self._figures: dict[str, Any] = {}
        self._process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=ENVIRONMENT, text=True
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def end(self) -> dict[str, Any]:
        if not self._figures:
            out, _ = self._process.communicate(timeout=60)
            self._figures = json.loads(out)
        return self._figures

    def __enter__(self) -> Robot:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()


@contextmanager
def nav2_follower(
    folder: Path, endpoint: str, ros2: dict[str, Any], **robot: Any
) -> Iterator[Path]:
    config, log = folder / "follow.yaml", folder / "follow.log"
    sections = {
        "robot": robot,
        "bus": {"mode": "client", "listen": [], "connect": [endpoint]},
        "ros2": {"follow": "nav2", "pose": "geometry_msgs/msg/PoseStamped", **ros2},
    }
    config.write_text(yaml.safe_dump(sections))
    with log.open("wb") as stderr:
        process = subprocess.Popen(
            [*PROGRAM, "follow", "--config", str(config), "--pose-age", "5"],
            stderr=stderr,
            env=ENVIRONMENT,
        )
    try:
        yield log
    finally:
        process.terminate()
        process.wait(30)
    assert process.returncode == 0, log.read_text()
    assert "Traceback" not in log.read_text(), log.read_text()


def passed(trail: Sequence[Point], points: Sequence[Point], near: float = 0.15) -> bool:
    """Tell whether a trail comes near to all of the lines between points, in their order."""
    index = 0
    for (ax, ay), (bx, by) in pairwise(points):
        count = max(int(math.dist((ax, ay), (bx, by)) / 0.1), 1)
        for part in range(count):
            wanted = (ax + (bx - ax) * part / count, ay + (by - ay) * part / count)
            while index < len(trail) and math.dist(trail[index], wanted) > near:
                index += 1
            if index == len(trail):
                return False
    return True


def kind_of(domain: int | None) -> dict[str, Any]:
    if domain is None:
        return {"kind": "bridge"}
    return {"kind": "rmw_zenoh", "domain": domain}
