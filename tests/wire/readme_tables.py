"""The tables of ``protocol/README.md`` as the data beside it has them, row by row.

``python -m tests.wire.readme_tables`` prints them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import yaml

from fasaco_edge.host.resources import folder

PROTOCOL = folder("protocol")
PREFIX = "{base}/@v1/{robot}/"

# Which subscription or query matches which keys of a robot `robot` under the base `fasaco`.
WILDCARDS: dict[str, str] = {
    "fasaco/**": "nothing",
    "**": "nothing",
    "fasaco/@v1/**": "all but the queries",
    "fasaco/@v1/robot/**": "all but the queries",
    "fasaco/@v1/robot/*": "all but the queries, `recorder/alive` and claims",
    "fasaco/@v1/*/status": "`status` of every robot",
    "fasaco/@v1/*/alive": "`alive` of every robot",
    "fasaco/@v1/**/alive": "`alive` and `recorder/alive` of every robot",
    "fasaco/@v1/robot/map*": "nothing: not even Zenoh takes it",
    "fasaco/@v1/robot/map$*": "`map` and `map_update`",
    "fasaco/@v1/robot/@rpc/*": "the queries",
    "fasaco/@v1/*/@rpc/status": "the query `status` of every robot",
    "fasaco/*/robot/path": "nothing",
}


def load(name: str) -> Any:
    """Return what a YAML file of the contract holds."""
    return yaml.safe_load((PROTOCOL / name).read_text())


def key_rows() -> list[str]:
    """Return the rows of the keys."""
    return [
        _row(
            f"`.../{entry['key'].removeprefix(PREFIX)}`",
            entry["direction"],
            _payload(entry),
            f"`{entry['qos']}`" if entry["qos"] else "-",
            "once a second" if entry["rate_hz"] == 1 else "on change",
            {True: "newest sample", False: "next sample", None: "liveliness"}[entry["latched"]],
        )
        for entry in load("keys.yaml")["keys"]
    ]


def qos_rows() -> list[str]:
    """Return the rows of the quality of service."""
    return [
        _row(
            f"`{name}`",
            qos["priority"],
            qos["reliability"],
            qos["congestion"],
            "yes" if qos["express"] else "no",
            str(qos["cache"]),
            qos["blocks"].partition(",")[0],
        )
        for name, qos in load("qos.yaml")["qos"].items()
    ]


def query_rows() -> list[str]:
    """Return the rows of the queries."""
    return [
        _row(
            f"`@rpc/{entry['name']}`",
            _names(entry["parameters"]),
            f"[{entry['payload']}](schema/{entry['payload']})" if entry["payload"] else "-",
            _typed(entry["schema"]) or f"[{entry['json']}](schema/{entry['json']})",
            entry["answered"],
            f"{entry['timeout_s']:g} s",
            _names(entry["errors"]),
        )
        for entry in load("keys.yaml")["queries"]
    ]


def error_rows() -> list[str]:
    """Return the rows of the errors."""
    return [
        _row(f"`{error['code']}`", ", ".join(error["from"]), f"`{error['message']}`", error["do"])
        for error in load("errors.yaml")["errors"]
    ]


def wildcard_rows() -> list[str]:
    """Return the rows of the wildcards."""
    return [_row(f"`{expression}`", matched) for expression, matched in WILDCARDS.items()]


def _payload(entry: dict[str, Any]) -> str:
    if entry["json"]:
        return f"[{entry['json']}](schema/{entry['json']})"
    *others, last = [_typed(schema) for schema in entry["schema"]] or ["-"]
    said = f"{', '.join(others)} or {last}" if others else last
    attached = entry["attachment"]
    return f"{said}, with [{attached}](schema/{attached})" if attached else said


def _typed(schema: str) -> str:
    return schema.replace("/msg/", "/")


def _names(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names) or "-"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    for rows in (key_rows, qos_rows, query_rows, wildcard_rows, error_rows):
        print(*rows(), "", sep="\n")
