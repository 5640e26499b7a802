"""The one way a message is refused: which field, what was expected, what came."""

from __future__ import annotations

from typing import NoReturn

from fasaco_edge.errors import MalformedMessage


def refuse(message: str, field: str, expected: str, got: object) -> NoReturn:
    """Raise MalformedMessage: ``message: field must be expected, got got``."""
    raise MalformedMessage(f"{message}: {field} must be {expected}, got {got}")
