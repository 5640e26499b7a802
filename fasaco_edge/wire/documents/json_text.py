"""JSON documents on the bus (RFC 8259: no NaN, no infinities).

Strict readers refuse a document with a member of the wrong type; tolerant readers, for documents
of other versions, drop that member. Both ignore unknown members.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

import msgspec
from msgspec import UNSET, Meta

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.limits import MAX_JSON_BYTES

# Bounds of a tolerant reader.
MAX_INTEGER = 2**63 - 1
MAX_NUMBER = 1e300
MAX_TEXT = 500

Struct = TypeVar("Struct", bound=msgspec.Struct)


def allowed(**schema: object) -> Meta:
    """Return a limit that a schema states and writers keep; readers do not check it."""
    return Meta(extra_json_schema=schema)


Count = Annotated[int, allowed(minimum=0)]
Ordinal = Annotated[int, allowed(minimum=1)]
Amount = Annotated[float, allowed(minimum=0)]
Name = Annotated[str, allowed(minLength=1)]


class Document(msgspec.Struct, frozen=True):
    """A JSON object whose writer sends all members."""


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


def decode_json(payload: bytes) -> dict[str, object]:
    """Return the JSON object in ``payload``.

    Raises:
        MalformedMessage: it is no JSON, no object, or longer than ``MAX_JSON_BYTES``.
    """
    if len(payload) > MAX_JSON_BYTES:
        raise MalformedMessage(f"JSON must have at most {MAX_JSON_BYTES} bytes, got {len(payload)}")
    try:
        return msgspec.json.decode(payload, type=dict[str, object])
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MalformedMessage(f"JSON object: {error}") from error
    except RecursionError as error:
        raise MalformedMessage("JSON object: nested too deeply") from error


def decode_document(payload: bytes, kind: type[Struct]) -> Struct:
    """Return the JSON object in ``payload`` as values of ``kind``.

    Raises:
        MalformedMessage: it is no JSON object, or a member is missing or of another type.
    """
    try:
        return msgspec.convert(decode_json(payload), kind)
    except msgspec.ValidationError as error:
        raise MalformedMessage(f"{kind.__name__.lower()}: {error}") from error


def decode_tolerant(payload: bytes, kind: type[Struct]) -> Struct:
    """Return the members of a JSON object that fit ``kind``; no bytes are an empty object.

    Raises:
        MalformedMessage: it is no JSON object.
    """
    return tolerant(decode_json(payload) if payload else {}, kind)


def tolerant(document: Mapping[str, object], kind: type[Struct]) -> Struct:
    """Return the members of a JSON object that fit ``kind``; others keep their defaults.

    Numbers beyond ``MAX_INTEGER`` and ``MAX_NUMBER`` do not fit, texts are cut at ``MAX_TEXT``.

    Raises:
        TypeError: a member without a default is missing, or does not fit.
    """
    # Nearly all documents fit as a whole: much faster than member by member. A deeply nested one
    # has unknown members.
    with suppress(msgspec.ValidationError, RecursionError):
        if _is_within_bounds(document):
            return msgspec.convert(document, kind)
    fitting = {
        field.name: _fitting(document.get(field.encode_name, UNSET), field.type)
        for field in msgspec.structs.fields(kind)
    }
    return kind(**{name: value for name, value in fitting.items() if value is not UNSET})


def _is_within_bounds(value: object) -> bool:
    if isinstance(value, dict):
        return all(map(_is_within_bounds, value.values()))
    if isinstance(value, list):
        return all(map(_is_within_bounds, value))
    if isinstance(value, str):
        return len(value) <= MAX_TEXT
    if isinstance(value, int | float):
        return abs(value) <= (MAX_INTEGER if isinstance(value, int) else MAX_NUMBER)
    return True


def _fitting(value: object, kind: Any) -> object:  # noqa: ANN401 - a type as annotations have it
    """Return a JSON value as one of ``kind``; UNSET where it does not fit."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _fitting(value, arguments[0])
    if origin in (Union, UnionType):
        fitting = (_fitting(value, option) for option in arguments)
        return next((found for found in fitting if found is not UNSET), UNSET)
    if origin is tuple and isinstance(value, list):
        items = (_fitting(item, arguments[0]) for item in value)
        return tuple(item for item in items if item is not UNSET)
    if origin is dict and isinstance(value, dict):
        entries = {key: _fitting(item, arguments[1]) for key, item in value.items()}
        return {key: item for key, item in entries.items() if item is not UNSET}
    return _fitting_plain(value, kind)


def _fitting_plain(value: object, kind: Any) -> object:  # noqa: ANN401 - a class, or None
    if isinstance(value, int | float) and abs(value) > (MAX_INTEGER if kind is int else MAX_NUMBER):
        return UNSET
    if isinstance(value, str) and kind is str:
        return value[:MAX_TEXT]
    if kind is object and not _is_within_bounds(value):
        return UNSET
    try:
        if isinstance(value, dict) and issubclass(kind, msgspec.Struct):
            return tolerant(value, kind)
        return msgspec.convert(value, kind)
    except (msgspec.ValidationError, TypeError):  # issubclass takes no None
        return UNSET


def _check_finite(value: object, where: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise MalformedMessage(f"{where} must be finite in JSON, got {value}")
    if isinstance(value, dict):
        for key, item in value.items():
            _check_finite(item, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            _check_finite(item, f"{where}[{index}]")
