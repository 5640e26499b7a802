"""All checks, in the order of the report. A new one is a function and a line here."""

from fasaco_edge.daemon.checks import (
    access,
    credentials,
    folders,
    kernels,
    machine,
    memory,
    session,
)
from fasaco_edge.daemon.checks.finding import Check

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
