"""All checks, in the order of the report. A new one is a function and a line here.

Looks at everything, and says what it found.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from fasaco_edge.config.config import DaemonConfig, load_config
from fasaco_edge.doctor import files as folders
from fasaco_edge.doctor import files as kernels
from fasaco_edge.doctor import machine, session
from fasaco_edge.doctor import machine as memory
from fasaco_edge.doctor import security as access
from fasaco_edge.doctor import security as credentials
from fasaco_edge.doctor.finding import Check, CheckContext, Finding, Level, find_unit
from fasaco_edge.errors import BadConfiguration, FasacoError

CHECKS = (
    Check("platform", machine.system, of_machine=True),
    Check("C library", machine.c_library, of_machine=True),
    Check("memory", memory.memory, of_machine=True),
    Check("clock", machine.clock, of_machine=True),
    Check("kernels", kernels.kernels, of_machine=True),
    Check("disk", folders.disk),
    Check("permissions", folders.permissions),
    Check("session", session.session),
    Check("peers", session.peers),
    Check("endpoints", access.endpoints),
    Check("identity", credentials.identity),
    Check("secret files", credentials.secret_files),
    Check("roles", access.roles),
    Check("limits", access.limits),
)


# For all together: a disk, a network or somebody on the bus may not answer.
PATIENCE_S = 2.0


class _Looking:
    """A check under way, in a thread that nobody waits for in the end."""

    def __init__(self, check: Check, patient: CheckContext) -> None:
        self._check, self._patient = check, patient
        self._found: Finding | None = None
        self._thread = threading.Thread(target=self._look, name=check.name, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        try:
            self._found = self._check.look(self._patient)
        except FasacoError as error:
            self._found = Finding(Level.WARN, str(error), error.hint)
        except Exception as error:
            # What is wrong with a computer may be what nobody thought of.
            said = f"could not be found out: {type(error).__name__}: {error}"
            self._found = Finding(Level.WARN, said, "please report this")

    def finding(self, deadline: float) -> Finding:
        """Return what it finds until ``deadline`` [s, monotonic]."""
        self._thread.join(max(deadline - time.monotonic(), 0.0))
        return self._found or Finding(
            Level.WARN,
            f"no answer after {PATIENCE_S:g} s",
            "look whether a disk or somebody on the bus hangs",
        )


def findings(
    path: Path | None, checks: Sequence[Check] = CHECKS, recordings: Path | None = None
) -> Iterator[tuple[str, Finding]]:
    """Yield the name of each check and what it finds.

    The first is the configuration; where that is refused only the computer is looked at besides.

    Args:
        path: a configuration; None for the defaults.
        checks: what to look at besides.
        recordings: where recordings are to go.
    """
    deadline = time.monotonic() + PATIENCE_S
    try:
        config, refused = load_config(path), None
        yield "configuration", Finding(Level.OK, str(path or "defaults, without a file"))
    except BadConfiguration as error:
        config, refused = DaemonConfig(), error
        yield "configuration", Finding(Level.FAIL, str(error), error.hint)
    patient = CheckContext(config, path, find_unit(), recordings)
    possible = [check for check in checks if refused is None or check.of_machine]
    for check, looking in [(check, _Looking(check, patient)) for check in possible]:
        yield check.name, looking.finding(deadline)
