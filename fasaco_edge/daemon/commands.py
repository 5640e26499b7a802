"""Commands to the mission: taken off the bus, and answered once the mission has decided."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.bus.session import Bus, Question, Reply
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.events import Answer, CommandReceived
from fasaco_edge.mission.order_document import read_command
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.status import decode_json, encode_error, encode_json


class Commands:
    """Serves ``@rpc/mission``; each question waits for its answer from the loop."""

    def __init__(self, bus: Bus, keys: Keys, mailbox: Mailbox[object]) -> None:
        self._count = 0
        # Those the mission has to decide on, by number, and those who only want to know.
        self._open: dict[int, Question] = {}
        self._curious: list[Question] = []
        self._decided: list[Answer] = []
        bus.take_questions(keys.rpc("mission"), partial(mailbox.post, "command"))

    def take(self, items: Sequence[tuple[str, object]]) -> list[CommandReceived]:
        """Return the commands in ``items``; what is none is answered at once."""
        commands = []
        for _, item in items:
            if not isinstance(item, Question):
                continue
            try:
                name, order = read_command(decode_json(item.payload or b'{"command":"status"}'))
            except FasacoError as error:
                item.answer(Reply(encode_error(error), is_error=True))
                continue
            if name == "status":
                self._curious.append(item)
                continue
            self._count += 1
            self._open[self._count] = item
            commands.append(CommandReceived(self._count, name, order))
        return commands

    @property
    def are_asked(self) -> bool:
        """Whether anybody waits for an answer."""
        return bool(self._open or self._curious)

    def note(self, answers: Sequence[Answer]) -> None:
        """Note what the mission has decided."""
        self._decided.extend(answers)

    def answer(self, report: dict[str, Any], *, is_kept: bool) -> None:
        """Answer who wants to know how it is; and who commanded, once that outlives the daemon."""
        payload = encode_json(report)
        for question in self._curious:
            question.answer(Reply(payload))
        self._curious.clear()
        if not is_kept:
            return
        for answer in self._decided:
            question = self._open.pop(answer.number)
            if answer.error is not None:
                question.answer(Reply(encode_error(answer.error), is_error=True))
            else:
                question.answer(Reply(payload))
        self._decided.clear()
