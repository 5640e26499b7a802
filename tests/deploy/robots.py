"""A robot in a lab, and how far the service says it is."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from tests.deploy.lab import ENVIRONMENT, Lab
from tests.deploy.service import Service

SPEED = 20


@contextmanager
def robot(lab: Lab) -> Iterator[subprocess.Popen[bytes]]:
    """A simulated robot that maps a building and follows the path, as long as this lasts."""
    words = lab.words("fasaco-edge", "simulate", "flat", "--speed", str(SPEED))
    process = subprocess.Popen(words, env=ENVIRONMENT, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(10.0)


def swept_m2(service: Service) -> int:
    """Return how much floor the unit's status says is swept [m2]."""
    said = re.search(r"(\d+)(?: of \d+)? m2 of floor swept", service.show("StatusText"))
    return int(said[1]) if said else 0
