"""Rows of the contract's pages that are made one by one: roles, and members without a row.

A role's row is written anew. A row of a member stays as it is written by hand; a member that has
none gets one from the docstring of its struct.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import msgspec

from fasaco_edge.bus.access import ROLES
from fasaco_edge.mission.orders.order import OrderDocument
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.replies import CoverageReport, FloorReport, MissionReport
from fasaco_edge.wire.documents.status import LedgerReport, Status
from tests.wire.make_schemas import schema_of

# Headings of the tables of members, and what has these members.
MEMBERS: dict[str, type[msgspec.Struct]] = {
    "member of `coverage`": CoverageReport,
    "member of `floor`": FloorReport,
    "member of `mission`": MissionReport,
    "member of `ledger`": LedgerReport,
    "member of `status`": Status,
    "member of a path": PathAttachment,
    "member of `order`": OrderDocument,
}


def role_rows() -> list[str]:
    """Return the rows of the roles that have no more rights than the table of topics gives them."""
    return [
        f"| `mapper` | {_names(ROLES['mapper'].speaks)} | - |",
        f"| `viewer` | - | {_names(ROLES['viewer'].listens)} |",
    ]


def with_roles(page: str) -> str:
    for row in role_rows():
        head = "|".join(row.split("|")[:2]) + "|"
        page = re.sub(rf"^{re.escape(head)}.*$", row, page, flags=re.MULTILINE)
    return page


def members_in(page: str, heading: str) -> list[str]:
    cells = [line.split(" | ")[0] for line in _table(page, heading).splitlines()[2:]]
    return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]


def with_members(page: str, heading: str) -> str:
    """Return a page whose table with this heading has a row for each member.

    Raises:
        LookupError: a member without a row has no description either.
    """
    table = _table(page, heading)
    if not table:
        return page
    struct = MEMBERS[heading]
    described = _properties(struct)
    added = [name for name in described if name not in members_in(page, heading)]
    for name in added:
        if not described[name].get("description"):
            where = f"{struct.__module__}.{struct.__name__}"
            raise LookupError(f"{where}: describe {name} below `Attributes:` of its docstring")
    rows = (f"| `{name}` | {described[name]['description']} |" for name in added)
    return page.replace(table, "\n".join([table, *rows]))


def _table(page: str, heading: str) -> str:
    start = page.find(f"\n| {heading} |")
    return page[start + 1 :].partition("\n\n")[0] if start >= 0 else ""


def _properties(struct: type[msgspec.Struct]) -> dict[str, Any]:
    properties: dict[str, Any] = schema_of(struct)["$defs"][struct.__name__]["properties"]
    return properties


def _names(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)
