"""Fields of a JSON object that another version may not send, or send otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Json = Mapping[str, Any]

# Integers beyond this are not whole in every JSON reader (RFC 8259, clause 6).
MAX_INTEGER = 2**53
MAX_TEXT = 500


def section(message: Json, name: str) -> Json:
    """Return the object in field ``name``; an empty one where there is none."""
    value = message.get(name)
    return value if isinstance(value, dict) else {}


def number(message: Json, name: str) -> float | None:
    """Return the number in field ``name``; None where there is none."""
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e300:
        return None
    return float(value)


def integer(message: Json, name: str) -> int | None:
    """Return the integer in field ``name``; None where there is none."""
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) > MAX_INTEGER:
        return None
    return value


def text(message: Json, name: str) -> str:
    """Return the text in field ``name``; "" where there is none."""
    value = message.get(name)
    return value[:MAX_TEXT] if isinstance(value, str) else ""
