"""Commands to the mission: queries that are answered once the mission has decided."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.bus.queries import Question, Reply
from fasaco_edge.bus.session import Bus
from fasaco_edge.daemon.loop.answers import check, error_reply
from fasaco_edge.errors import BadQuery, CommandError, FasacoError
from fasaco_edge.mission.core.events import Answer, CommandReceived
from fasaco_edge.mission.orders.order import (
    EVERYTHING_ONCE,
    CommandName,
    MissionOrder,
    read_command,
)
from fasaco_edge.wire import replies
from fasaco_edge.wire.json_text import decode_json, encode_json
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_JSON_BYTES

# A robot whose path changes all the time drives badly: it is planned anew no more often [s].
REPLAN_PERIOD_S = 1.0
# A document of JSON, and its question.
QUERY_BYTES = MAX_JSON_BYTES + 4096


class Commands:
    """Serves ``@rpc/mission`` and ``@rpc/replan``; a question waits until the loop answers."""

    def __init__(self, bus: Bus, keys: Keys, mailbox: Mailbox[object]) -> None:
        self._count = 0
        # Questions that the mission decides on, by number, and those for the status alone.
        self._open: dict[int, Question] = {}
        self._status_questions: list[Question] = []
        self._decided: list[Answer] = []
        self._replan_key = keys.rpc("replan")
        self._replanned_at = float("-inf")
        too_long = error_reply(BadQuery(f"a query must have at most {QUERY_BYTES} bytes"))
        for name in ("mission", "replan"):
            post = partial(mailbox.post, "command")
            bus.take_questions(keys.rpc(name), post, QUERY_BYTES, too_long)

    def take(self, questions: Sequence[Question], now: float) -> list[CommandReceived]:
        """Return the commands in ``questions``; one that is none is answered at once."""
        commands = []
        for question in questions:
            try:
                name, order = self._read(question, now)
            except FasacoError as error:
                question.answer(error_reply(error))
                continue
            if name == "status":
                self._status_questions.append(question)
                continue
            self._count += 1
            self._open[self._count] = question
            commands.append(CommandReceived(self._count, name, order))
        return commands

    def _read(self, question: Question, now: float) -> tuple[CommandName, MissionOrder]:
        request = question.request
        if question.key == self._replan_key:
            check(request)
            if request.key.endswith("*"):
                # A wildcard query means to change nothing.
                raise BadQuery("replan has to be asked for by its name")
            command: tuple[CommandName, MissionOrder] = ("replan", EVERYTHING_ONCE)
        else:
            check(request, payload=True)
            command = read_command(decode_json(request.payload or b'{"command":"status"}'))
        if command[0] == "replan":
            waits_s = self._replanned_at + REPLAN_PERIOD_S - now
            if waits_s > 0:
                raise CommandError(
                    f"planned anew less than {REPLAN_PERIOD_S:g} s ago",
                    hint=f"ask again in {waits_s:.1f} s",
                )
        return command

    @property
    def are_asked(self) -> bool:
        """Whether anybody waits for an answer."""
        return bool(self._open or self._status_questions)

    def note(self, answers: Sequence[Answer], now: float) -> None:
        """Note what the mission has decided."""
        self._decided.extend(answers)
        if any(answer.plan is not None for answer in answers):
            self._replanned_at = now

    def answer(self, report: replies.Reply, *, is_kept: bool) -> None:
        """Answer questions for the status; and commands, once the ledger has them on disk."""
        payload = encode_json(report)
        for question in self._status_questions:
            question.answer(Reply(payload))
        self._status_questions.clear()
        if not is_kept:
            return
        for answer in self._decided:
            question = self._open.pop(answer.number)
            if answer.error is not None:
                question.answer(error_reply(answer.error))
            elif question.key == self._replan_key:
                assert answer.plan is not None
                accepted = replies.Replan(report.robot, answer.plan)
                question.answer(Reply(encode_json(accepted)))
            else:
                question.answer(Reply(payload))
        self._decided.clear()
