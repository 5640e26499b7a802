"""JSON documents on the bus (RFC 8259: no NaN, no infinities).

Strict readers refuse a document with a member of the wrong type or out of its range; tolerant
readers, for documents of other versions, drop that member. Both ignore unknown members. Both refuse
a document if a number in it or its depth is beyond the limits, even in an unknown member: decoded
numbers are safe to calculate with.
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
from fasaco_edge.text import one_line
from fasaco_edge.wire.limits import (
    MAX_COORDINATE_M,
    MAX_JSON_BYTES,
    MAX_JSON_DEPTH,
    MAX_JSON_INTEGER,
    MAX_JSON_NUMBER,
    MAX_STRING_BYTES,
)

# A tolerant reader cuts texts at this length.
MAX_TEXT = 500
# Hint for a document that is refused.
OF_JSON = "send a JSON object as the schema of this key describes it (protocol/schema)"

Struct = TypeVar("Struct", bound=msgspec.Struct)


def allowed(**schema: object) -> Meta:
    """Return a limit that a schema states and writers observe; readers do not check it.

    Limits of numbers, which readers check, are given by ``Meta(ge=...)``.
    """
    return Meta(extra_json_schema=schema)


Count = Annotated[int, Meta(ge=0, extra_json_schema={"minimum": 0})]
Ordinal = Annotated[int, Meta(ge=1, extra_json_schema={"minimum": 1})]
Amount = Annotated[float, Meta(ge=0, extra_json_schema={"minimum": 0})]
Name = Annotated[str, allowed(minLength=1)]
Text = Annotated[str, Meta(max_length=MAX_STRING_BYTES)]
ZenohId = Annotated[str, allowed(pattern="^[0-9a-f]{1,32}$")]
Coordinate = Annotated[float, Meta(ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M)]
Angle = Annotated[float, Meta(ge=-360, le=360)]
Corners = Annotated[tuple[tuple[float, float], ...], allowed(maxItems=1000)]
Settings = dict[str, object]
"""The configuration in force, without secrets, by sections."""


class Document(msgspec.Struct, frozen=True):
    """A JSON object whose writer sends all members."""


def encode_json(message: object) -> bytes:
    """Return ``message`` (dicts, lists, dataclasses, structs, plain values) as JSON.

    Raises:
        MalformedMessage: a number in it is not finite, or it is beyond the limits of readers.
        TypeError: a value in it has no form in JSON.
    """
    plain = msgspec.to_builtins(message, str_keys=True)
    # msgspec would write null for a number that is not finite.
    _check_limits(plain, "message")
    return msgspec.json.encode(plain)


def decode_json(payload: bytes) -> dict[str, object]:
    """Return the JSON object in ``payload``.

    Raises:
        MalformedMessage: it is not JSON, not an object, or beyond a limit: ``MAX_JSON_BYTES``,
            ``MAX_JSON_DEPTH``, for integers ``MAX_JSON_INTEGER``, for other numbers
            ``MAX_JSON_NUMBER``.
    """
    if len(payload) > MAX_JSON_BYTES:
        text = f"JSON must have at most {MAX_JSON_BYTES} bytes, got {len(payload)}"
        raise MalformedMessage(text, hint=OF_JSON)
    try:
        document = msgspec.json.decode(payload, type=dict[str, object])
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MalformedMessage(f"JSON object: {error}", hint=OF_JSON) from error
    except RecursionError as error:
        raise MalformedMessage("JSON object: nested too deeply", hint=OF_JSON) from error
    _check_limits(document, "JSON object")
    return document


def decode_document(payload: bytes, kind: type[Struct]) -> Struct:
    """Return the JSON object in ``payload`` as a struct of type ``kind``.

    Raises:
        MalformedMessage: it is not a JSON object, or a member is missing or of another type.
    """
    try:
        return msgspec.convert(decode_json(payload), kind)
    except msgspec.ValidationError as error:
        raise MalformedMessage(f"{kind.__name__.lower()}: {error}", hint=OF_JSON) from error


def decode_tolerant(payload: bytes, kind: type[Struct]) -> Struct:
    """Return the members of a JSON object that fit ``kind``; b"" counts as an empty object.

    Raises:
        MalformedMessage: it is not a JSON object.
    """
    return tolerant(decode_json(payload) if payload else {}, kind)


def tolerant(document: Mapping[str, object], kind: type[Struct]) -> Struct:
    """Return the members of a JSON object that fit ``kind``; others keep their defaults.

    A member beyond a limit of numbers or depth does not fit; texts are cut at ``MAX_TEXT``.

    Raises:
        TypeError: a member without a default is missing, or does not fit.
    """
    # Nearly all documents fit as a whole, which is much faster than member by member. A document
    # may be nested too deeply for that, in unknown members.
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
    return len(value) <= MAX_TEXT if isinstance(value, str) else _is_in_range(value)


def _is_in_range(value: object) -> bool:
    """Return False for a number beyond the limits, and for NaN; True for any other value."""
    if not isinstance(value, int | float):
        return True
    return abs(value) <= (MAX_JSON_INTEGER if isinstance(value, int) else MAX_JSON_NUMBER)


def _fitting(value: object, kind: Any) -> object:  # noqa: ANN401 - any type annotation
    """Return a JSON value as a ``kind``; UNSET if it does not fit."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        # Only a number has a range.
        is_plain = arguments[0] in (int, float)
        return _fitting_plain(value, kind) if is_plain else _fitting(value, arguments[0])
    if origin in (Union, UnionType):
        fitting = (_fitting(value, option) for option in arguments)
        return next((found for found in fitting if found is not UNSET), UNSET)
    if origin is tuple and isinstance(value, list):
        if Ellipsis not in arguments:
            # A tuple of fixed length fits as a whole or not at all, as a corner does.
            return _fitting_plain(value, kind)
        items = (_fitting(item, arguments[0]) for item in value)
        return tuple(item for item in items if item is not UNSET)
    if origin is dict and isinstance(value, dict):
        entries = {key: _fitting(item, arguments[1]) for key, item in value.items()}
        return {key: item for key, item in entries.items() if item is not UNSET}
    return _fitting_plain(value, kind)


def _fitting_plain(value: object, kind: Any) -> object:  # noqa: ANN401 - a class, or None
    if not _is_in_range(value):
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


def _check_limits(value: object, where: str, depth: int = 0) -> None:
    """Check the numbers and the depth of a tree of plain values.

    Raises:
        MalformedMessage: a number is not finite or beyond its limit, or it is nested too deeply.
    """
    if not _is_in_range(value):
        if isinstance(value, float) and not math.isfinite(value):
            text = f"{_short(where)} must be finite in JSON, got {value}"
            raise MalformedMessage(text, hint=OF_JSON)
        if isinstance(value, int):
            limit, shown = f"{MAX_JSON_INTEGER}", "an integer beyond that"
        else:
            limit, shown = f"{MAX_JSON_NUMBER:g}", f"{value:g}"
        text = f"{_short(where)} must be from -{limit} to {limit}, got {shown}"
        raise MalformedMessage(text, hint=OF_JSON)
    if isinstance(value, dict | list | tuple):
        if depth == MAX_JSON_DEPTH:
            raise MalformedMessage(
                f"{_short(where)}: nested too deeply, {MAX_JSON_DEPTH} levels are the limit",
                hint=OF_JSON,
            )
        if isinstance(value, dict):
            for key, item in value.items():
                _check_limits(item, f"{where}.{key}", depth + 1)
        else:
            for index, item in enumerate(value):
                _check_limits(item, f"{where}[{index}]", depth + 1)


def _short(where: str) -> str:
    return one_line(where, 120)
