"""Report of all checks, each run in a thread. A new check is a function and a row of ``CHECKS``."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from fasaco_edge.config.cautions import cautions
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.reload import read_config
from fasaco_edge.doctor import computer, security, session
from fasaco_edge.doctor.finding import Check, CheckContext, Finding, fail, find_unit, ok, warn
from fasaco_edge.errors import BadConfiguration, FasacoError

CHECKS = (
    Check("platform", computer.system, of_machine=True),
    Check("memory", computer.memory, of_machine=True),
    Check("clock", computer.clock, of_machine=True),
    Check("kernels", computer.kernels, of_machine=True),
    Check("disk", computer.disk),
    Check("permissions", computer.permissions),
    Check("session", session.session),
    Check("peers", session.peers),
    Check("endpoints", security.endpoints),
    Check("identity", security.identity),
    Check("secret files", security.secret_files),
    Check("roles", security.roles),
)


# Timeout of all checks together [s]: a disk, a network or a peer on the bus may hang.
PATIENCE_S = 2.0


class _RunningCheck:
    """A check in a thread of its own, as it may hang."""

    def __init__(self, check: Check, context: CheckContext) -> None:
        self._check, self._context = check, context
        self._found: Finding | None = None
        self._thread = threading.Thread(target=self._look, name=check.name, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        try:
            self._found = self._check.look(self._context)
        except FasacoError as error:
            self._found = warn(str(error), error.hint)
        except Exception as error:
            # A computer may have unforeseen faults.
            said = f"check failed: {type(error).__name__}: {error}"
            self._found = warn(said, "please report this")

    def finding(self, deadline: float) -> Finding:
        """Return the check's finding by ``deadline`` [s, monotonic]."""
        self._thread.join(max(deadline - time.monotonic(), 0.0))
        return self._found or warn(
            f"no answer after {PATIENCE_S:g} s", "check whether a disk or a peer on the bus hangs"
        )


def findings(
    path: Path | None, checks: Sequence[Check] = CHECKS, recordings: Path | None = None
) -> Iterator[tuple[str, Finding]]:
    """Yield the name and finding of each check.

    The configuration in the file ``path``, None for the defaults, is checked first; if it is
    refused, only checks of the computer follow. ``recordings``: folder for recordings.
    """
    deadline = time.monotonic() + PATIENCE_S
    try:
        config, refused = read_config(path), None
        assumed = [said] if (said := config.robot.assumed) else []
        found = str(path or "defaults, without a file")
        if together := cautions(config):
            found = f"{found}: settings that do not go together"
            yield "configuration", warn(found, "; ".join(together), assumed)
        else:
            yield "configuration", ok(found, details=assumed)
    except BadConfiguration as error:
        config, refused = DaemonConfig(), error
        yield "configuration", fail(str(error), error.hint, map(str, error.rest))
    context = CheckContext(config, path, find_unit(), recordings)
    possible = [check for check in checks if refused is None or check.of_machine]
    for check, running in [(check, _RunningCheck(check, context)) for check in possible]:
        yield check.name, running.finding(deadline)
