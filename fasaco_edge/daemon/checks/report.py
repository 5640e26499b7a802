"""Looks at everything, and says what it found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from fasaco_edge.daemon.checks.finding import Check, Finding, Level, Patient
from fasaco_edge.daemon.checks.table import CHECKS
from fasaco_edge.daemon.config import load_config
from fasaco_edge.errors import BadConfiguration


def findings(path: Path | None, checks: Sequence[Check] = CHECKS) -> Iterator[tuple[str, Finding]]:
    """Yield the name of each check and what it finds.

    The first is the configuration; where that is refused it is the last.

    Args:
        path: a configuration; None for the defaults.
        checks: what to look at besides.
    """
    source = str(path) if path else "defaults, without a file"
    try:
        patient = Patient(load_config(path), source)
    except BadConfiguration as error:
        yield "configuration", Finding(Level.FAIL, str(error), error.hint)
        return
    yield "configuration", Finding(Level.OK, source)
    for check in checks:
        yield check.name, check.look(patient)
