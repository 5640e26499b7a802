"""Files of ``protocol/`` that are made from the package; ``make contract`` writes them all.

From ``fasaco_edge.wire.topics``: keys and queries of ``keys.yaml``, ``qos.yaml``, the key
expressions of the session templates, the tables of the pages. From the typed documents: the
schemas, see ``tests.wire.make_schemas``, and rows of members, see ``tests.wire.page_rows``. From
``fasaco_edge.states``: the table of states.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import yaml

from fasaco_edge.bus import access
from fasaco_edge.host.resources import folder
from fasaco_edge.states import State
from fasaco_edge.wire.query_table import QUERIES, Query
from fasaco_edge.wire.topic_types import Topic
from fasaco_edge.wire.topics import QOS, TOPICS
from tests.wire import make_schemas, page_rows

PROTOCOL = folder("protocol")
# What people read of it.
PAGES = sorted(set(PROTOCOL.glob("*.md")) - {PROTOCOL / "CHANGELOG.md"})
CONTRACT = "\n".join(page.read_text() for page in PAGES)
PREFIX = "{base}/@v1/{robot}/"

# Which subscription or query matches which keys of a robot `robot` under the base `fasaco`.
WILDCARDS: dict[str, str] = {
    "fasaco/**": "nothing",
    "**": "nothing",
    "fasaco/@v1/**": "all but the queries",
    "fasaco/@v1/robot/**": "all but the queries",
    "fasaco/@v1/robot/*": "all but the queries, `recorder/alive`, claims and drivers",
    "fasaco/@v1/*/status": "`status` of every robot",
    "fasaco/@v1/*/alive": "`alive` of every robot",
    "fasaco/@v1/**/alive": "`alive` and `recorder/alive` of every robot",
    "fasaco/@v1/robot/map*": "nothing: Zenoh rejects it",
    "fasaco/@v1/robot/map$*": "`map` and `map_update`",
    "fasaco/@v1/robot/@rpc/*": "the queries",
    "fasaco/@v1/*/@rpc/status": "the query `status` of every robot",
    "fasaco/*/robot/path": "nothing",
}


def load(name: str) -> Any:
    """Return what a YAML file of the contract holds; by libyaml, as each worker reads them all."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.load((PROTOCOL / name).read_text(encoding="utf-8"), loader)


def key_entry(topic: Topic) -> dict[str, Any]:
    is_token = topic.qos is None
    return {
        "name": topic.name,
        "key": PREFIX + topic.suffix,
        "direction": topic.direction,
        "schema": list(topic.schemas),
        "json": topic.json or None,
        "attachment": topic.attachment or None,
        "encoding": (
            None if is_token else "application/cdr" if topic.schemas else "application/json"
        ),
        "latched": None if is_token else topic.is_latched,
        "qos": None if is_token else topic.name,
        "rate_hz": topic.rate_hz or None,
        "one_publisher_s": topic.one_publisher_s or None,
        "when": topic.when,
        "limits": list(topic.limits),
    }


def query_entry(query: Query) -> dict[str, Any]:
    return {
        "name": query.name,
        "key": PREFIX + query.suffix,
        "payload": query.payload or None,
        "schema": query.schema,
        "json": query.json or None,
        "answered": query.answered,
        "timeout_s": query.timeout_s,
        "errors": list(query.errors),
    }


def qos_entry(topic: Topic) -> dict[str, Any]:
    qos = QOS[topic.name]
    blocked = f"the {topic.speaker}, 5 s; the daemon takes each sample in at once"
    return {
        "reliability": "reliable",
        "congestion": qos.congestion,
        "priority": qos.priority,
        "express": qos.express,
        "cache": qos.cache,
        "blocks": blocked if qos.congestion == "block" else "none",
    }


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


def state_rows() -> list[str]:
    """Return the rows of the states."""
    meant = make_schemas.descriptions(State.__doc__ or "")
    return [_row(f"`{state.value}`", meant[state.name]) for state in State]


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


def template_grants() -> dict[str, list[access.Grant]]:
    """Return by session template the grants that its rules are made from."""
    roles = ("mapper", "viewer", "operator", "recorder")
    robot = [access.Grant(role, [role], "fasaco/@v1/robot") for role in roles]
    routed = [
        access.Grant(role, [name], f"fasaco/@v1/{name}", of=name)
        for name in ("r1", "r2")
        for role in ("robot", "mapper")
    ]
    routed += [access.Grant("fleet", ["r1", "r2"], "fasaco/@v1/*")]
    routed += [access.Grant(role, [role], "fasaco/@v1/*") for role in roles[1:]]
    return {"robot": robot, "user-robot": robot, "router": routed}


def with_keys(template: str, grants: Sequence[access.Grant]) -> str:
    rules = access.access_control(grants, "usernames")["rules"]
    limits = access.limits(grants[-1].prefix, access.SenderLimits())
    found = {rule["id"]: rule["key_exprs"] for rule in (*rules, *limits["low_pass_filter"])}
    rates = {
        part["id"]: [rule["key_expr"] for rule in part["rules"]] for part in limits["downsampling"]
    }

    def listed(match: re.Match[str]) -> str:
        return f"{match[1]}{_wrapped(found[match[2]], len(match[3]))},\n"

    def rated(match: re.Match[str]) -> str:
        frequency = dict(re.findall(r'key_expr: "([^"]+)", freq: ([\d.]+)', match[4]))
        (usual, *_) = frequency.values()
        lines = (
            f'        {{ key_expr: "{key}", freq: {frequency.get(key, usual)} }},\n'
            for key in rates[match[2]]
        )
        return f"{match[1]}[\n{''.join(lines)}      ],\n"

    rule = r'(id: "([^"]+)",(?:(?!id: ).)*?'
    text = re.sub(rule + r"\n( +)key_exprs: )\[.*?\],\n", listed, template, flags=re.DOTALL)
    before, mark, after = text.partition("  downsampling: [")
    return (
        before
        + mark
        + re.sub(rule + r"\n( +)rules: )\[\n(.*?)\],\n", rated, after, flags=re.DOTALL)
    )


def write() -> None:
    make_schemas.write(PROTOCOL / "schema")
    keys = PROTOCOL / "keys.yaml"
    head, _, rest = keys.read_text().partition("\nkeys:\n")
    about_queries = "# What can be asked" + rest.partition("# What can be asked")[2]
    about_queries, _, rest = about_queries.partition("\nqueries:\n")
    ros = "# Under ROS 2" + rest.partition("# Under ROS 2")[2]
    keys.write_text(
        f"{head}\nkeys:\n{_listed(map(key_entry, TOPICS))}\n"
        f"{about_queries}\nqueries:\n{_listed(map(query_entry, QUERIES))}\n{ros}"
    )
    qos = PROTOCOL / "qos.yaml"
    head, _, _ = qos.read_text().partition("\nqos:\n")
    entries = (
        f"  {topic.name}:\n{_reason(topic)}"
        + "".join(f"    {line}\n" for line in _lines(qos_entry(topic)))
        for topic in TOPICS
        if topic.name in QOS
    )
    qos.write_text(f"{head}\nqos:\n" + "\n".join(entries))
    for name, grants in template_grants().items():
        template = PROTOCOL / "config" / f"{name}.json5"
        template.write_text(with_keys(template.read_text(), grants))
    for head, rows in TABLES.items():
        (page,) = (page for page in PAGES if f"\n| {head} |" in page.read_text())
        pattern = rf"(^\| {re.escape(head)} \|.*\n\|[-|: ]+\n)(?:\|.*\n)*"
        text, count = re.subn(
            pattern,
            lambda m, rows=rows: m[1] + "\n".join(rows()) + "\n",
            page.read_text(),
            flags=re.MULTILINE,
        )
        assert count == 1, head
        page.write_text(text)
    for page in PAGES:
        text = page_rows.with_roles(page.read_text())
        for heading in page_rows.MEMBERS:
            text = page_rows.with_members(text, heading)
        page.write_text(text)


TABLES: Mapping[str, Callable[[], list[str]]] = {
    "key | direction": key_rows,
    "key | priority": qos_rows,
    "query": query_rows,
    "expression": wildcard_rows,
    "code": error_rows,
    "state | meaning": state_rows,
}


def _reason(topic: Topic) -> str:
    why = QOS[topic.name].why
    return f"    # {why}\n" if why else ""


def _listed(entries: Iterable[dict[str, Any]]) -> str:
    return "\n".join(
        "".join(f"{'  - ' if n == 0 else '    '}{line}\n" for n, line in enumerate(_lines(entry)))
        for entry in entries
    )


def _lines(entry: Mapping[str, Any]) -> list[str]:
    lines = []
    for name, value in entry.items():
        if name == "schema" and isinstance(value, list) and len(value) > 1:
            lines += [f"{name}:", *(f"  - {item}" for item in value)]
        elif isinstance(value, list):
            lines.append(f"{name}: [{', '.join(value)}]")
        elif name == "key" or value == "":
            lines.append(f"{name}: {json.dumps(value)}")
        elif value is None or isinstance(value, bool | float | int):
            shown = json.dumps(value)
            lines.append(f"{name}: {'1' if name == 'rate_hz' and value == 1 else shown}")
        else:
            lines.append(f"{name}: {value}")
    return lines


def _wrapped(keys: Sequence[str], indent: int) -> str:
    """Return a JSON list, in lines of at most 100 characters where one is too short for it."""
    items = [json.dumps(key) for key in keys]
    flat = f"[{', '.join(items)}]"
    if indent + len("key_exprs: ") + len(flat) < 100:
        return flat
    lines, line = [], ""
    for item in items:
        if line and indent + 2 + len(line) + len(item) > 98:
            lines.append(line.rstrip())
            line = ""
        line += f"{item}, "
    body = "\n".join(f"{' ' * (indent + 2)}{one}" for one in [*lines, line.rstrip()])
    return f"[\n{body}\n{' ' * indent}]"


if __name__ == "__main__":
    write()
