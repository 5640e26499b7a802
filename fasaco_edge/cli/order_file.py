"""Orders in files: YAML, JSON or GeoJSON; a fault is named with its line."""

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

# A member at the start of an error's text, and one in it that is unknown.
_NAMED = re.compile(r"(?:the order|the collection|([\w.\[\]]*))(?:: unknown member ([^;]+))?")


def read_order_file(path: Path) -> MissionOrder:
    """Return the order in a file.

    Raises:
        OrderError: naming file, line, member or feature, what was expected and what came.
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
    told = []
    for said in (_at_origin(str(fault), origins) for fault in faults):
        line = _line_of(said, text)
        told.append(f"{path}, line {line}: {said}" if line else f"{path}: {said}")
    hints = dict.fromkeys(fault.hint for fault in faults)
    raise OrderError("\n".join(told), hint="; ".join(hints))


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
        # YAML 1.1 would take 1e3 for a text.
        return json.loads(text) if path.suffix in (".json", SUFFIX) else load(text)
    except RecursionError as error:
        raise OrderError("nested too deeply") from error
    except ValueError as error:
        raise OrderError(f"neither plain YAML nor JSON: {error}") from error


def _faults_of_features(document: dict[str, object]) -> Iterator[OrderError]:
    """Yield what is wrong with each feature of a collection alone."""
    features = document.get("features")
    for index, feature in enumerate(features if isinstance(features, list) else ()):
        try:
            order_of({"type": document["type"], "features": [feature]})
        except OrderError as error:
            text = str(error).replace("features[0]", f"features[{index}]", 1)
            yield OrderError(text, hint=error.hint)


def _at_origin(said: str, origins: dict[str, str]) -> str:
    """Return an error's text with the feature in place of the zone or keep-out made of it."""
    place = re.match(r"(?:zones|keep_out)\[\d+\]", said)
    if place is None or place[0] not in origins:
        return said
    return f"{origins[place[0]]}: {said[place.end() :].lstrip('.: ')}"


def _line_of(said: str, text: str) -> int | None:
    """Return the line of the member that an error's text begins with; None if it is not known."""
    named = _NAMED.match(said)
    key = ".".join(filter(None, named.groups())) if named else ""
    try:
        node, _ = compose(text.replace("\t", " "))  # JSON may have tabs
    except PlainYamlError:
        return None
    return ConfigText(None, dict(keys_and_lines(node))).line_of(key)
