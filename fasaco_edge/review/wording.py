"""The wording of amounts in a review."""

from __future__ import annotations

NOT_KNOWN = "not known"
SWEPT_BY_OTHERS = "swept by others"


def amount(value: float | None, unit: str) -> str:
    """Return a value with its unit."""
    if value is None:
        return NOT_KNOWN
    digits = 0 if abs(value) >= 100 or value == round(value) else 1 if abs(value) >= 10 else 2
    return f"{value:,.{digits}f} {unit}".rstrip()


def count(value: float | None, unit: str) -> str:
    """Return a value with its unit: a whole number with all digits, others with one decimal."""
    if value is None:
        return NOT_KNOWN
    text = f"{value:,}" if isinstance(value, int) else f"{value:,.1f}"
    return f"{text} {unit}".rstrip()
