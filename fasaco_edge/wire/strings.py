"""Strings as CDR has them: UTF-8 with one NUL, at the end."""

from __future__ import annotations

from fasaco_edge.wire.limits import MAX_STRING_BYTES
from fasaco_edge.wire.refusal import refuse


def encoded_string(value: str, message: str, field: str) -> bytes:
    """Return ``value`` in UTF-8 with its NUL.

    Raises:
        MalformedMessage: it is too long, holds a NUL, or has no UTF-8.
    """
    try:
        text = value.encode()
    except UnicodeEncodeError as error:
        refuse(message, field, "UTF-8", f"{value!r} ({error.reason})")
    if len(text) > MAX_STRING_BYTES or 0 in text:
        refuse(message, field, f"at most {MAX_STRING_BYTES} bytes without NUL", repr(value))
    return text + b"\0"


def decoded_string(text: bytes, message: str, field: str) -> str:
    """Return the string in ``text``, its NUL included.

    Raises:
        MalformedMessage: it has no NUL at its end, another before, or is no UTF-8.
    """
    if text.find(0) != len(text) - 1:
        refuse(message, field, "a string with one NUL, at its end", repr(text))
    try:
        return text[:-1].decode()
    except UnicodeDecodeError as error:
        refuse(message, field, "UTF-8", f"{text!r} ({error.reason})")
