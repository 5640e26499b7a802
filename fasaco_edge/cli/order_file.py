"""The reader of orders in YAML, JSON or GeoJSON files; errors name the line of each fault."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

from fasaco_edge.cli.geojson import SUFFIX, is_geojson, order_of
from fasaco_edge.config.reading import ConfigText, keys_and_lines
from fasaco_edge.errors import OrderError
from fasaco_edge.host.plain_yaml import PlainYamlError, compose, load, read_bounded
from fasaco_edge.mission.orders.commands import order_faults
from fasaco_edge.mission.orders.order import MissionOrder, read_order

# The member at the start of an error's text, and an unknown member in the text.
_NAMED = re.compile(r"(?:the order|the collection|([\w.\[\]]*))(?:: unknown member ([^;]+))?")


def read_order_file(path: Path) -> MissionOrder:
    """Return the order in a file.

    Raises:
        OrderError: the file cannot be read, or the order is invalid; it lists all faults with file
            and line.
    """
    text = _text(path)
    origins: dict[str, str] = {}
    faults: list[OrderError] = []
    try:
        document = _parsed(path, text)
        if is_geojson(document):
            faults = list(_faults_of_features(document))
            document, origins = order_of(document) if not faults else ({}, origins)
        faults = faults or order_faults(document)
        if not faults:
            return read_order(document)
    except OrderError as error:
        faults = [error]
    messages = []
    for message in (_at_origin(str(fault), origins) for fault in faults):
        line = _line_of(message, text)
        messages.append(f"{path}, line {line}: {message}" if line else f"{path}: {message}")
    hints = dict.fromkeys(fault.hint for fault in faults)
    raise OrderError("\n".join(messages), hint="; ".join(hints))


def _text(path: Path) -> str:
    try:
        return read_bounded(path)
    except OSError as error:
        hint = "name a file that can be read"
        raise OrderError(f"{path}: {error.strerror}", hint=hint) from error
    except PlainYamlError as error:
        raise OrderError(f"{path}: {error}") from error


def _parsed(path: Path, text: str) -> object:
    try:
        # JSON is not read as YAML 1.1, in which 1e3 is a text.
        return json.loads(text) if path.suffix in (".json", SUFFIX) else load(text)
    except RecursionError as error:
        raise OrderError("nested too deeply") from error
    except ValueError as error:
        raise OrderError(f"neither plain YAML nor JSON: {error}") from error


def _faults_of_features(document: dict[str, object]) -> Iterator[OrderError]:
    """Yield the first fault of each feature of a collection."""
    features = document.get("features")
    for index, feature in enumerate(features if isinstance(features, list) else ()):
        try:
            order_of({"type": document["type"], "features": [feature]})
        except OrderError as error:
            text = str(error).replace("features[0]", f"features[{index}]", 1)
            yield OrderError(text, hint=error.hint)


def _at_origin(message: str, origins: dict[str, str]) -> str:
    """Return an error's text with zone or keep-out replaced by the feature that it comes from."""
    place = re.match(r"(?:zones|keep_out)\[\d+\]", message)
    if place is None or place[0] not in origins:
        return message
    return f"{origins[place[0]]}: {message[place.end() :].lstrip('.: ')}"


def _line_of(message: str, text: str) -> int | None:
    """Return the line of the member at the start of an error's text; None if unknown."""
    named = _NAMED.match(message)
    key = ".".join(filter(None, named.groups())) if named else ""
    try:
        node, _ = compose(text.replace("\t", " "))  # JSON may have tabs
    except PlainYamlError:
        return None
    return ConfigText(None, dict(keys_and_lines(node))).line_of(key)
