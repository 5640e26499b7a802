"""Questions to a daemon on the bus, and its answer."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from typing import TYPE_CHECKING

from fasaco_edge.cli.console.arguments import add_robot_on_bus, client_settings, seconds
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.errors import FasacoError, NobodyAnswersError
from fasaco_edge.text import one_line

if TYPE_CHECKING:
    from fasaco_edge.bus.queries import Reply
    from fasaco_edge.wire.replies import Error

TIMEOUT_S = 5.0


def nobody_answers(prefix: str, robots: Collection[str]) -> NobodyAnswersError:
    """Return the error that no daemon answers at ``prefix``, where these robots are."""
    names = one_line(", ".join(sorted(robots)))
    there = f"there are {names}: give one as --robot" if names else "there is none"
    return NobodyAnswersError(
        f"no daemon answers at {prefix}",
        hint=f"of robots on this bus {there}; `fasaco-edge run` starts a daemon",
    )


class RefusedError(FasacoError):
    """The daemon's answer is an error."""

    def __init__(self, answer: Error) -> None:
        super().__init__(one_line(answer.message), hint=one_line(answer.hint))
        self.code = answer.code


def add_question(parser: argparse.ArgumentParser) -> None:
    """Add whom to ask, how long to wait, and how to show the answer."""
    parser.add_argument("--json", action="store_true", help="print the answer as JSON")
    parser.add_argument(
        "--timeout",
        type=seconds,
        default=TIMEOUT_S,
        metavar="S",
        help="how long to wait for the answer (default: %(default)s)",
    )
    add_robot_on_bus(parser)


def ask(args: argparse.Namespace, name: str, parameters: str = "", payload: bytes = b"") -> Reply:
    """Ask; ``parameters`` as they stand behind ``?``.

    Raises:
        RefusedError: the answer is an error; with ``--json`` it is printed as it came.
        NobodyAnswersError: there is no answer in time.
        BusUnavailable: nobody listens at the endpoint.
    """
    from fasaco_edge.bus.session import open_bus
    from fasaco_edge.wire.json_text import decode_json, decode_tolerant
    from fasaco_edge.wire.keys import Keys
    from fasaco_edge.wire.replies import Error

    keys = Keys(args.robot, args.base)
    selector = keys.rpc(name) + (f"?{parameters}" if parameters else "")
    with open_bus(client_settings(args)) as bus:
        replies = bus.get(selector, args.timeout, payload)
        if not replies:
            alive = bus.alive(f"{args.base}/@v1/*/alive")
            raise nobody_answers(keys.prefix, {key.split("/")[-2] for key in alive})
    reply = replies[0]
    if reply.is_error:
        if args.json:
            print_json(decode_json(reply.payload))
        raise RefusedError(decode_tolerant(reply.payload, Error))
    return reply
