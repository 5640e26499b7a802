"""All checks, in the order of the report. A new one is a function and a line here."""

from fasaco_edge.daemon.checks import access, credentials
from fasaco_edge.daemon.checks.finding import Check

CHECKS = (
    Check("endpoints", access.endpoints),
    Check("identity", credentials.identity),
    Check("secret files", credentials.secret_files),
    Check("roles", access.roles),
    Check("limits", access.limits),
)
