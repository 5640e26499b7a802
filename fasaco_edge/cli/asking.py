"""A question to a daemon on the bus, and what comes of it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from fasaco_edge.cli.arguments import add_robot_on_bus, client_settings
from fasaco_edge.errors import FasacoError

if TYPE_CHECKING:
    from fasaco_edge.bus.queries import Reply

TIMEOUT_S = 5.0


class RefusedError(FasacoError):
    """The daemon's answer is an error."""

    def __init__(self, answer: dict[str, Any]) -> None:
        super().__init__(str(answer.get("message")), hint=str(answer.get("hint", "")))
        self.code = str(answer.get("code"))


class NobodyAnswersError(FasacoError):
    """No daemon of that robot is on the bus."""

    code = "nobody_answers"


def add_question(parser: argparse.ArgumentParser) -> None:
    """Add whom to ask, how long to wait, and how to show the answer."""
    parser.add_argument("--json", action="store_true", help="print the answer as JSON")
    parser.add_argument(
        "--timeout",
        type=_seconds,
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
    from fasaco_edge.wire.keys import Keys
    from fasaco_edge.wire.status import decode_json

    keys = Keys(args.robot, args.base)
    selector = keys.rpc(name) + (f"?{parameters}" if parameters else "")
    with open_bus(client_settings(args)) as bus:
        replies = bus.get(selector, args.timeout, payload)
        if not replies:
            raise _nobody(keys.prefix, bus.alive(f"{args.base}/@v1/*/alive"))
    reply = replies[0]
    if reply.is_error:
        if args.json:
            print(reply.payload.decode())
        raise RefusedError(decode_json(reply.payload))
    return reply


def _nobody(prefix: str, alive: list[str]) -> NobodyAnswersError:
    robots = sorted(key.split("/")[-2] for key in alive)
    there = f"there are {', '.join(robots)}: give one as --robot" if robots else "there is none"
    return NobodyAnswersError(
        f"no daemon answers at {prefix}",
        hint=f"of robots on this bus {there}; `fasaco-edge run` starts a daemon",
    )


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    # A negated comparison, so that NaN is caught too.
    if not 0 < seconds <= 3600:
        raise argparse.ArgumentTypeError(f"must be in (0, 3600] s, got {text!r}")
    return seconds
