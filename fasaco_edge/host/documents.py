"""Documents that people write, read into structs, with all faults, each with its key.

First come the values that do not fit their types, then the faults that the structs find themselves
(``StrictDocument.faults``).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from types import UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

import msgspec
from msgspec import UNSET, structs

from fasaco_edge.errors import DocumentError, nested_key, together
from fasaco_edge.text import nearest, shown

# An annotation of a type, and a value of that type.
_Kind: TypeAlias = Any
_Value: TypeAlias = Any
# Number of values that do not fit, after which the search for them ends.
MOST_FAULTS = 50
# Where unknown keys are allowed: similarity to a missing key from which a key counts as misspelt.
ALIKE = 0.8


class StrictDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A document, or an object in one, in which unknown keys are errors.

    If it ``is_open``, it may have keys of other programs; only misspelt keys are errors.
    """

    is_open: ClassVar[bool] = False

    def faults(self) -> Iterator[DocumentError]:
        """Yield the faults that types do not show; keys are relative to this object.

        A member whose value does not fit has its default or, without a default, is UNSET, which is
        false. An object or list in a list becomes UNSET, too.
        """
        yield from ()


_Struct = TypeVar("_Struct", bound=msgspec.Struct)
_Error = TypeVar("_Error", bound=DocumentError)


def inspected(
    kind: type[_Struct], document: object, error: type[_Error]
) -> tuple[_Struct, list[_Error]]:
    """Return a parsed document as a struct, and all its faults.

    For members at fault see ``StrictDocument.faults``; a document that is no object becomes UNSET.
    """
    reader = _Reader(kind, error)
    read: _Struct = reader.read(kind, document, "")
    faulty = [key for fault in reader.faults for key in (fault.key, *fault.others)]
    return read, reader.faults + [
        fault
        for fault in misfits(read, error)
        if not any(_touch(key, each) for key in (fault.key, *fault.others) for each in faulty)
    ]


def converted(kind: type[_Struct], document: object, error: type[_Error]) -> _Struct:
    """Return a parsed document as a struct.

    Raises:
        DocumentError: an ``error``, the first fault, which holds the others as ``rest``.
    """
    read, faults = inspected(kind, document, error)
    if faults:
        raise together(faults)
    return read


def misfits(held: object, error: type[_Error], key: str = "") -> Iterator[_Error]:
    """Yield the faults that a struct at ``key``, and the structs in it, find themselves."""
    if isinstance(held, msgspec.Struct):
        for name, encoded in zip(
            held.__struct_fields__, held.__struct_encode_fields__, strict=True
        ):
            yield from misfits(getattr(held, name), error, nested_key(key, encoded))
        if isinstance(held, StrictDocument):
            for fault in held.faults():
                yield fault.within(key, error)
    elif isinstance(held, list | tuple):
        for index, item in enumerate(held):
            if isinstance(item, msgspec.Struct):
                yield from misfits(item, error, f"{key}[{index}]")


# Words for the types and bounds that msgspec names, and for the parts of texts and lists.
_KINDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text",
    "bool": "true or false",
    "array": "a list",
    "object": "a mapping",
}
_BOUNDS = {">=": "of at least", "<=": "of at most", ">": "above", "<": "below"}
_ITEMS = {"str": "letters", "array": "items"}


class _Reader:
    """Converts a document of type ``root`` part by part, and collects the faults."""

    def __init__(self, root: type[msgspec.Struct], error: type[Any]) -> None:
        self.faults: list[Any] = []
        self._root, self._error = root, error

    def read(self, kind: _Kind, value: object, key: str) -> _Value:
        """Return a value as ``kind``, without the parts that do not fit; UNSET if no part fits."""
        try:
            return msgspec.convert(value, kind)
        except (msgspec.ValidationError, UnicodeEncodeError) as error:
            # A lone surrogate raises UnicodeEncodeError, which names no place.
            message = "Invalid text" if isinstance(error, UnicodeEncodeError) else str(error)
        before, read = len(self.faults), UNSET
        if before >= MOST_FAULTS:
            return UNSET
        where, expected, misfit = _misfit(message, value)
        if _is_bare_item(kind, value):
            where, expected, misfit = "", "expected a list: write [ ] around it", value
        elif isinstance(value, dict) and (struct := _struct(kind)):
            read = self._members(struct, value, key)
        elif (
            (where or message == "Invalid text")
            and isinstance(value, list)
            and (of := _of_items(kind))
        ):
            read = self._items(of, value, key)
        # If no part has a fault, the value has one itself. Unknown keys may be of other programs.
        if len(self.faults) == before and not expected.startswith("object contains unknown"):
            expected = _expected(kind, expected) if where else _shaped(kind, expected)
            if isinstance(misfit, str) and re.fullmatch(r"-?\d+,\d+", misfit):
                expected += " with a decimal point"
            # Null, true and false are shown as YAML and JSON write them.
            is_word = misfit is None or isinstance(misfit, bool)
            given = json.dumps(misfit) if is_word else shown(misfit)
            self._add(key + where, f"{expected}, got {given:.100}")
        return read

    def _members(self, kind: type[msgspec.Struct], value: dict[Any, object], key: str) -> _Value:
        fields = {field.encode_name: field for field in structs.fields(kind)}
        for name in (each for each in value if not isinstance(each, str)):
            # "{radius_m: 0,2}" has the keys radius_m and 2.
            comma = "; a number has a decimal point, no comma" if value[name] is None else ""
            self._add(key, f"expected a text as key, got {shown(name)}{comma}")
        is_open = getattr(kind, "is_open", False)
        misspelt: set[str] = set()
        for name in (each for each in value if isinstance(each, str) and each not in fields):
            if not is_open or nearest(name, fields.keys() - value.keys(), ALIKE):
                what, meant = self._unknown(name, key, list(fields))
                self._add(nested_key(key, name), what, meant)
                misspelt |= set(meant)
        members = {field.name: UNSET for field in fields.values() if field.required}
        for name, field in fields.items():
            if name in value:
                read = self.read(field.type, value[name], nested_key(key, name))
                members |= {} if read is UNSET else {field.name: read}
            elif field.required and nested_key(key, name) not in misspelt:
                self._add(nested_key(key, name), "missing")
        return kind(**members)

    def _items(self, kind: _Kind, value: list[object], key: str) -> _Value:
        items = [self.read(kind, item, f"{key}[{index}]") for index, item in enumerate(value)]
        return items if _struct(kind) or _of_items(kind) else UNSET

    def _unknown(self, name: str, key: str, known: list[str]) -> tuple[str, list[str]]:
        """Return what is wrong with an unknown key, and the keys that it was meant for."""
        meant = [nested_key(key, each) for each in nearest(name, known)]
        # The key may belong elsewhere in the document.
        meant = meant or [path for path in _paths(self._root) if path.rpartition(".")[2] == name]
        if meant:
            return f"unknown key; did you mean {' or '.join(meant)}?", meant
        return f"unknown key; there are {', '.join(known)}", []

    def _add(self, key: str, what: str, others: Sequence[str] = ()) -> None:
        if len(self.faults) < MOST_FAULTS:
            self.faults.append(self._error(what, key=key, others=others))


def _touch(one: str, other: str) -> bool:
    """Return whether two keys are equal, or one lies in the other."""
    return f"{one}.".startswith((f"{other}.", f"{other}[")) or other.startswith(
        (f"{one}.", f"{one}[")
    )


def _paths(kind: type[msgspec.Struct], before: str = "") -> Iterator[str]:
    """Yield all keys of a struct and of the structs in it, but not of lists."""
    for field in structs.fields(kind):
        yield (path := nested_key(before, field.encode_name))
        if struct := _struct(field.type):
            yield from _paths(struct, path)


def _arms(kind: _Kind) -> list[Any]:
    """Return the types of a union, or the type alone, without annotations."""
    origin: object = get_origin(kind)
    if origin is Annotated:
        return _arms(get_args(kind)[0])
    if origin in (Union, UnionType):
        return [arm for each in get_args(kind) for arm in _arms(each)]
    return [kind]


def _struct(kind: _Kind) -> type[msgspec.Struct] | None:
    structs_of = (arm for arm in _arms(kind) if isinstance(arm, type))
    return next((arm for arm in structs_of if issubclass(arm, msgspec.Struct)), None)


def _of_items(kind: _Kind) -> _Kind:
    """Return the type of the items of a list of any length; None for other types."""
    for arm in _arms(kind):
        origin, args = get_origin(arm), get_args(arm)
        if origin is list or (origin is tuple and args[1:] == (...,)):
            return args[0]
    return None


def _expected(kind: _Kind, expected: str) -> str:
    """Return what a type expects: the allowed words, if it allows only some."""
    arms = _arms(kind)
    words = [str(each) for arm in arms if get_origin(arm) is Literal for each in get_args(arm)]
    are_words = all(get_origin(arm) is Literal or arm is bool for arm in arms)
    if words and (are_words or expected.startswith("invalid enum value")):
        words += ["a number"] if float in arms else []
        return "expected " + " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))
    # YAML 1.1 reads 8:1 as a number.
    return _in_words(expected) + (", in quotes" if expected == "expected str" else "")


def _is_bare_item(kind: _Kind, value: object) -> bool:
    """Return whether a value is an item of the list that was expected."""
    if not value or _of_items(kind) is None:
        return False
    try:
        msgspec.convert([value], kind)
    except (msgspec.ValidationError, UnicodeEncodeError):
        return False
    return True


def _shaped(kind: _Kind, expected: str) -> str:
    """Return what a type expects, and the required keys of a mapping."""
    words, struct = _expected(kind, expected), _struct(kind)
    required = (
        [each.encode_name for each in structs.fields(struct) if each.required] if struct else []
    )
    shape = ", ".join(f"{name}: ..." for name in required)
    return words.replace("a mapping", f"a mapping such as {{{shape}}}") if shape else words


def _in_words(expected: str) -> str:
    """Return what msgspec expected, such as "expected float > 0.0 | null", in words."""
    if not expected.startswith("expected "):
        return expected
    arms = []
    for arm in expected.removeprefix("expected ").split(" | "):
        kind, _, bound = arm.partition(" ")
        sign, _, limit = bound.removeprefix("of length ").rpartition(" ")
        words = [_KINDS.get(kind, kind)]
        if bound:
            words += [_BOUNDS.get(sign, sign or "of"), limit.removesuffix(".0")]
        if bound.startswith("of length "):
            words.append(_ITEMS[kind].removesuffix("s" * (limit == "1")))
        arms.append(" ".join(words))
    return "expected " + " or ".join(arms)


def _misfit(message: str, value: _Value) -> tuple[str, str, object]:
    """Return where a value does not fit, what was expected there, and what is there.

    ``message``: of a ``msgspec.ValidationError``, as "Expected `int` >= 1 - at `$.passes[0]`".
    """
    what, _, where = message.replace("`", "").partition(" - at $")
    for name, index in re.findall(r"\.(\w+)|\[(\d+)\]", where):
        value = value[name] if name else value[int(index)]
    return where, what[0].lower() + what[1:].partition(", got ")[0], value
