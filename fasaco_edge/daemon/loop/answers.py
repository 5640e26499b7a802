"""Replies to queries for configuration, versions and commands.

Queries for configuration and versions are answered on a Zenoh thread, without the loop; commands
are answered once the mission has decided.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import metadata
from typing import cast

import msgspec

from fasaco_edge import __version__
from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.bus.queries import QueryReply, Question, Request, Shared, matches
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import BadQuery, CommandError, FasacoError, UnknownQuery
from fasaco_edge.mission.events import Answer, CommandReceived
from fasaco_edge.mission.orders.commands import read_command
from fasaco_edge.mission.orders.order import Command
from fasaco_edge.wire.documents import replies
from fasaco_edge.wire.documents.json_text import Settings, decode_json, encode_json
from fasaco_edge.wire.documents.replies import Version, encode_error
from fasaco_edge.wire.keys import VERSION, Keys
from fasaco_edge.wire.limits import MAX_JSON_BYTES
from fasaco_edge.wire.messages.ros_node import (
    Triggered,
    check_request,
    encode_response,
    response_attachment,
)
from fasaco_edge.wire.query_table import RPC_NAMES

# Least period of requested replans, as a path that keeps changing is hard to follow [s].
REPLAN_PERIOD_S = 1.0
# Limit on a query with its JSON document [bytes].
QUERY_BYTES = MAX_JSON_BYTES + 4096
AnyReply = QueryReply | Shared

_NO_WILDCARD = "ask by the whole key, without *"


def error_reply(error: FasacoError) -> QueryReply:
    return QueryReply(encode_error(error), is_error=True)


def answering(answer: Callable[[Request], AnyReply]) -> Callable[[Request], AnyReply]:
    """Wrap ``answer`` so that an error it raises becomes the reply."""

    def answered(request: Request) -> AnyReply:
        try:
            return answer(request)
        except FasacoError as error:
            return error_reply(error)

    return answered


def check(request: Request, *, payload: bool = False) -> None:
    """Check that a query has no parameters, and a payload only if it takes one.

    Raises:
        BadQuery: the query has a parameter or payload; the text names it.
    """
    name = request.key.rpartition("/")[2]
    for parameter in request.parameters:
        raise BadQuery(f"{name} takes no parameters, got {parameter!r}")
    if request.payload and not payload:
        raise BadQuery(f"{name} takes no payload, got one of {len(request.payload)} bytes")


SECRET = re.compile(r"password|passphrase|secret|private_key|credential|token", re.IGNORECASE)
LEFT_OUT = "(left out)"


def serve_about(bus: Bus, keys: Keys, config: Callable[[], DaemonConfig]) -> None:
    """Serve the current ``config`` and ``version``; reply to unknown queries with a list."""
    version = Version(__version__, VERSION.removeprefix("@"), metadata.version("eclipse-zenoh"))
    documents: dict[str, Callable[[], object]] = {
        "config": lambda: config_document(config()),
        "version": lambda: version,
    }
    for name, document in documents.items():
        bus.serve(keys.rpc(name), answering(partial(_document_reply, document)))
    bus.serve(f"{keys.prefix}/@rpc/*", partial(_unknown, keys), complete=False)


def config_document(config: DaemonConfig) -> Settings:
    """Return the configuration in force without secrets.

    An endpoint may carry any Zenoh setting after its ``#``, also keys and passwords: that part
    is left out.
    """
    return cast(Settings, _shown(msgspec.to_builtins(config)))


def _shown(value: object) -> object:
    if isinstance(value, dict):
        return {
            name: LEFT_OUT if item and SECRET.search(str(name)) else _shown(item)
            for name, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [_shown(item) for item in value]
    if isinstance(value, str) and re.match(r"\w+/[^#]*#", value):
        return f"{value.partition('#')[0]}#{LEFT_OUT}"
    return value


def _document_reply(document: Callable[[], object], request: Request) -> QueryReply:
    check(request)
    return QueryReply(encode_json(document()))


def _unknown(keys: Keys, request: Request) -> QueryReply | None:
    """Return the error for a query with an unknown name; None for known names."""
    if any(matches(request.key, keys.rpc(name)) for name in RPC_NAMES):
        return None
    name = request.key.rpartition("/")[2]
    return error_reply(
        UnknownQuery(f"there is no query {name!r}; there are {', '.join(RPC_NAMES)}")
    )


class Commands:
    """Serves ``@rpc/mission`` and ``@rpc/replan``; a query waits until the loop replies.

    ``services``: commands of ROS 2 services by key; their requests arrive in the mailbox, too.
    """

    def __init__(
        self,
        bus: Bus,
        keys: Keys,
        mailbox: Mailbox[object],
        services: Mapping[str, Triggered] | None = None,
    ) -> None:
        self._count = 0
        self._services = services or {}
        # Queries with a command, by number, and queries for the status alone.
        self._open: dict[int, Question] = {}
        self._status_questions: list[Question] = []
        self._decided: list[Answer] = []
        self._replan_key = keys.rpc("replan")
        self._replanned_at = float("-inf")
        too_long = error_reply(
            BadQuery(f"a query must have at most {QUERY_BYTES} bytes", hint="send a shorter one")
        )
        for name in ("mission", "replan"):
            post = partial(mailbox.post, "command")
            bus.take_questions(keys.rpc(name), post, QUERY_BYTES, too_long)

    def take(self, questions: Sequence[Question], now: float) -> list[CommandReceived]:
        """Return the commands in ``questions``; an invalid one gets an error reply at once."""
        commands = []
        for question in questions:
            try:
                asked = self._read(question, now)
            except FasacoError as error:
                self._refuse(question, error)
                continue
            if asked.name == "status":
                self._status_questions.append(question)
                continue
            self._count += 1
            self._open[self._count] = question
            commands.append(CommandReceived(self._count, *asked))
        return commands

    def _read(self, question: Question, now: float) -> Command:
        request = question.request
        if (triggered := self._services.get(question.key)) is not None:
            check_request(request.payload)
            if "*" in request.key:
                raise BadQuery("a service has to be called by its name", hint=_NO_WILDCARD)
            return Command(triggered)
        if question.key == self._replan_key:
            check(request)
            if request.key.endswith("*"):
                # A wildcard query must change nothing.
                raise BadQuery("replan has to be asked for by its name", hint=_NO_WILDCARD)
            command = Command("replan")
        else:
            check(request, payload=True)
            command = read_command(decode_json(request.payload or b'{"command":"status"}'))
        if command.name == "replan":
            waits_s = self._replanned_at + REPLAN_PERIOD_S - now
            if waits_s > 0:
                raise CommandError(
                    f"planned anew less than {REPLAN_PERIOD_S:g} s ago",
                    hint=f"ask again in {waits_s:.1f} s",
                )
        return command

    @property
    def has_open_queries(self) -> bool:
        """Whether a query waits for its reply."""
        return bool(self._open or self._status_questions)

    def note(self, answers: Sequence[Answer], now: float) -> None:
        """Note the mission's decisions."""
        self._decided.extend(answers)
        if any(answer.plan is not None for answer in answers):
            self._replanned_at = now

    def answer(self, report: replies.Reply, *, is_kept: bool) -> None:
        """Reply to queries for the status; and to commands, once the ledger has them on disk."""
        payload = encode_json(report)
        for question in self._status_questions:
            question.answer(QueryReply(payload))
        self._status_questions.clear()
        if not is_kept:
            return
        for answer in self._decided:
            question = self._open.pop(answer.number)
            if answer.error is not None:
                self._refuse(question, answer.error)
            elif question.key in self._services:
                self._respond(question, f"{report.state}: {report.reason}", success=True)
            elif question.key == self._replan_key:
                assert answer.plan is not None
                accepted = replies.Replan(report.robot, answer.plan)
                question.answer(QueryReply(encode_json(accepted)))
            else:
                question.answer(QueryReply(payload))
        self._decided.clear()

    def _refuse(self, question: Question, error: FasacoError) -> None:
        if question.key in self._services:
            hint = f" ({error.hint})" if error.hint else ""
            self._respond(question, f"{error}{hint}", success=False)
        else:
            question.answer(error_reply(error))

    def _respond(self, question: Question, message: str, *, success: bool) -> None:
        """Reply to the request of a service, on the key of the request."""
        request = question.request
        beside = response_attachment(request.attachment, time.time_ns())
        payload = encode_response(message, success=success)
        question.answer(QueryReply(payload, attachment=beside), request.key)
