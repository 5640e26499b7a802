"""JSON on the bus: status, commands, error replies (RFC 8259; NaN and infinities have no place)."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.wire.limits import MAX_JSON_BYTES


def encode_json(message: object) -> bytes:
    """Return ``message`` (dicts, lists, dataclasses, structs, plain values) as JSON.

    Raises:
        MalformedMessage: a number in it is not finite.
        TypeError: a value in it has no JSON.
    """
    plain = msgspec.to_builtins(message, str_keys=True)
    # msgspec would write null.
    _check_finite(plain, "message")
    return msgspec.json.encode(plain)


def decode_json(payload: bytes) -> dict[str, Any]:
    """Return the JSON object in ``payload``.

    Raises:
        MalformedMessage: it is no JSON, no object, or longer than ``MAX_JSON_BYTES``.
    """
    if len(payload) > MAX_JSON_BYTES:
        raise MalformedMessage(f"JSON must have at most {MAX_JSON_BYTES} bytes, got {len(payload)}")
    try:
        return msgspec.json.decode(payload, type=dict[str, Any])
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MalformedMessage(f"JSON object: {error}") from error
    except RecursionError as error:
        raise MalformedMessage("JSON object: nested too deeply") from error


def encode_error(error: FasacoError) -> bytes:
    """Return the reply for a failed query: JSON with code, message and hint."""
    return encode_json({"code": error.code, "message": str(error), "hint": error.hint})


def _check_finite(value: object, where: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise MalformedMessage(f"{where} must be finite in JSON, got {value}")
    if isinstance(value, dict):
        for key, item in value.items():
            _check_finite(item, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            _check_finite(item, f"{where}[{index}]")


def is_the_planners(payload: bytes) -> bool:
    """Tell whether a status is of the daemon that plans; another of its name may wait.

    What cannot be read is, so that whoever reads it says so.
    """
    try:
        claim = decode_json(payload).get("claim")
    except MalformedMessage:
        return True
    return not isinstance(claim, dict) or claim.get("stand", "plans") == "plans"
