"""A review's document as JSON values."""

from __future__ import annotations

from typing import Any

import msgspec

from fasaco_edge.review.conversion import document_of
from fasaco_edge.review.review import Review


def document(review: Review) -> dict[str, Any]:
    """Return the document of ``review`` as ``review --json`` prints it."""
    found: dict[str, Any] = msgspec.to_builtins(document_of(review))
    return found
