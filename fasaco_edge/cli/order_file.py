"""The reader of orders in YAML, JSON or GeoJSON files; errors name the line of each fault."""

from __future__ import annotations

import json
from pathlib import Path

from fasaco_edge.cli.geojson import SUFFIX, drawn_order, is_geojson
from fasaco_edge.errors import OrderError
from fasaco_edge.host.documents import inspected
from fasaco_edge.host.plain_yaml import read_written
from fasaco_edge.mission.orders.order import MissionOrder, OrderDocument, order_of


def read_order_file(path: Path) -> MissionOrder:
    """Return the order in a file.

    Raises:
        OrderError: the file cannot be read, or the order is invalid: the first fault with the
            others, each with file and line.
    """
    # JSON is not read as YAML 1.1, in which 1e3 is a text.
    parse = json.loads if path.suffix in (".json", SUFFIX) else None
    text = read_written(path, OrderError, missing="name a file that can be read", parse=parse)
    if text.values is None:
        # It may be the rest of a file that was not written in full.
        hint = 'write what to cover; for everything, `passes: 1` (in JSON {"passes": 1})'
        text.check([OrderError("there is no order in it", hint=hint)])
    if is_geojson(text.values):
        order, faults = drawn_order(text.values)
    else:
        order, faults = inspected(OrderDocument, text.values, OrderError)
    text.check(faults)
    return order_of(order)
