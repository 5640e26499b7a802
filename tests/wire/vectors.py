"""The golden bytes of ``protocol/vectors``, with what their indexes say of them.

New ones are written by another library (``tests.wire.oracle``), never by the package's encoders.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from tests.wire.contract_files import PROTOCOL, load


@dataclass(frozen=True)
class Vector:
    """A payload, its name, the type it claims to be, and what its index says of it."""

    name: str
    schema: str
    payload: bytes
    facts: dict[str, Any]


@cache
def vectors(kind: Literal["valid", "hostile"]) -> list[Vector]:
    """Return the payloads that every decoder reads, or those that it refuses."""
    folder = PROTOCOL / "vectors" / kind
    return [
        Vector(
            entry["file"].removesuffix(".bin"),
            entry["schema"],
            (folder / entry["file"]).read_bytes(),
            {name: value for name, value in entry.items() if name not in ("file", "schema")},
        )
        for entry in load(f"vectors/{kind}/index.yaml")
    ]
