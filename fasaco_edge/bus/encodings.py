"""Zenoh encodings: CDR with the name of its type, or JSON."""

from __future__ import annotations

import zenoh

CDR = zenoh.Encoding.APPLICATION_CDR
JSON = zenoh.Encoding.APPLICATION_JSON


def encoding_of(schema: str) -> zenoh.Encoding:
    """Return the encoding of a CDR type; of JSON for ""."""
    return CDR.with_schema(schema) if schema else JSON


def schema_of(encoding: zenoh.Encoding) -> str:
    """Return the type that an encoding names, "" for none."""
    return str(encoding).partition(";")[2]
