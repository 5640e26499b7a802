"""Replies: what a daemon answers to commands and queries, beside the status."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from fasaco_edge.errors import FasacoError
from fasaco_edge.wire.json_text import encode_json
from fasaco_edge.wire.status import (
    CoverageReport,
    Document,
    MissionReport,
    Name,
    Ordinal,
    State,
)


class Reply(Document, frozen=True):
    """The answer to a command that was taken."""

    robot: Name
    state: State
    reason: str
    coverage: CoverageReport | None
    mission: MissionReport


class Replan(Document, frozen=True):
    """The answer to a wish for a new plan that was taken.

    Attributes:
        plan: number of the plan: it is made once plan.plans of the status has come to it.
    """

    robot: Name
    plan: Ordinal
    accepted: Annotated[bool, Meta(extra_json_schema={"const": True})] = True


class Version(Document, frozen=True):
    """What answers.

    Attributes:
        version: of the package.
        protocol: of these keys.
        zenoh: of eclipse-zenoh.
    """

    version: str
    protocol: Annotated[str, Meta(extra_json_schema={"pattern": "^v[0-9]+$"})]
    zenoh: str
    package: Annotated[str, Meta(extra_json_schema={"const": "fasaco-edge"})] = "fasaco-edge"


class Error(Document, frozen=True, forbid_unknown_fields=True):
    """Every answer that is an error. It comes as Zenoh's error reply.

    Attributes:
        code: one of those in errors.yaml.
        message: what was wrong, and where.
        hint: what to do about it; may be empty.
    """

    code: Annotated[str, Meta(extra_json_schema={"pattern": "^[a-z_]+$"})]
    message: Name
    hint: str


def encode_error(error: FasacoError) -> bytes:
    """Return the reply for a failed query."""
    return encode_json(Error(error.code, str(error), error.hint))
