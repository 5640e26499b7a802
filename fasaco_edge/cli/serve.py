"""``fasaco-edge serve``: the web page of a robot's mission, live or recorded."""

from __future__ import annotations

import argparse
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_robot_on_bus, robot_on_bus
from fasaco_edge.errors import BadConfiguration, MissingExtra
from fasaco_edge.host.addresses import Address, read_address
from fasaco_edge.text import one_line

if TYPE_CHECKING:
    import ssl
    from collections.abc import Callable, Iterator

    from fasaco_edge.serve.guard import Guard
    from fasaco_edge.serve.recorded import Playback
    from fasaco_edge.serve.server import Server

PORT = 8465
# Options that do not apply to a recording.
NOT_RECORDED = ("allow_commands", "config", "robot", "base", "connect", "security")
EPILOG = f"""\
examples:
  fasaco-edge serve                                    http://127.0.0.1:{PORT}, without commands
  fasaco-edge serve --allow-commands                   all users of this computer may command
  fasaco-edge serve --listen 0.0.0.0:{PORT} --tokens page-tokens
                                                       for phones: prints a link for each role
  fasaco-edge serve --connect tcp/192.168.1.20:7447 --robot hall2
  fasaco-edge serve run00001-*.rrd                     a recorded mission, with a time line

The page shows map, swept floor, path, zones and robot, and starts, pauses and sends home where that
is allowed. It is a client of the bus, as `watch` is, with the credentials of --config or
--security; commands need an operator's credentials.

With FILE.rrd the same page shows the recording, without commands: map, path, driven track and swept
floor at each time, and state and figures by the last status; one status in 15 s is recorded.

FILE of --tokens has lines `viewer: TOKEN` and `operator: TOKEN`; if it does not exist, it is
written with new tokens. A page asks for a token, or has it behind the # of its address. Without
--certificate tokens and pictures go over the network unencrypted.

exit codes: 0 ended by a signal; 1 the address is not available, or FILE.rrd cannot be read; 78
wrong configuration
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings",
        nargs="*",
        type=Path,
        metavar="FILE.rrd",
        help="the parts of a recorded run; without them, the page is live",
    )
    parser.add_argument(
        "--listen",
        default=f"127.0.0.1:{PORT}",
        metavar="HOST:PORT",
        help="address to serve at (default: %(default)s)",
    )
    parser.add_argument(
        "--allow-commands",
        action="store_true",
        help="let all users of this computer command the robot",
    )
    parser.add_argument(
        "--tokens",
        type=Path,
        metavar="FILE",
        help="tokens of viewers and operators; required to listen on other addresses than loopback",
    )
    parser.add_argument(
        "--name",
        action="append",
        default=[],
        metavar="NAME",
        help="a further host name by which browsers open the page, beside addresses and this "
        "computer's name; may be repeated",
    )
    parser.add_argument(
        "--certificate", type=Path, metavar="FILE", help="serve over TLS with this certificate"
    )
    parser.add_argument("--private-key", type=Path, metavar="FILE", help="key of the certificate")
    add_robot_on_bus(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until SIGTERM or SIGINT."""
    from fasaco_edge.host.processes import return_soon
    from fasaco_edge.serve.guard import guard_for

    try:
        from fasaco_edge.serve.server import Server
    except ImportError as error:
        if (error.name or "").partition(".")[0] != "websockets":
            raise
        raise MissingExtra(
            f"the page needs websockets, which is not installed: {error}",
            hint="pip install 'fasaco-edge[serve]'",
        ) from error
    address = read_address("--listen", args.listen, example=PORT)
    guard = guard_for(address, args.tokens, args.name, allow_commands=args.allow_commands)
    return_soon()
    if args.recordings:
        guard = guard.to_look_only()
        with _recording(args) as source_of:
            return _serve(Server(guard, source_of), args, address, guard)
    from fasaco_edge.client.feed import Feed
    from fasaco_edge.serve.served_view import ServedView
    from fasaco_edge.serve.server import LiveServer

    here = robot_on_bus(args)
    with Feed(here.bus, here.keys, with_fleet=True) as feed:
        server = LiveServer(feed, ServedView(here.keys), guard)
        return _serve(server, args, address, guard)


@contextmanager
def _recording(args: argparse.Namespace) -> Iterator[Callable[[], Playback]]:
    """Open a recording; yield a function that returns the source of a viewer's messages."""
    for option in NOT_RECORDED:
        if getattr(args, option):
            raise BadConfiguration(
                f"--{option.replace('_', '-')}: a page of a recording has no commands and no bus",
                hint="leave it out, or leave out FILE.rrd",
            )
    from fasaco_edge.cli.console.recordings import files_of_a_run
    from fasaco_edge.recording.read.frames import is_fleet_recording
    from fasaco_edge.recording.read.timeline import open_timeline
    from fasaco_edge.serve.recorded import Playback

    args.recordings = files_of_a_run(args.recordings)
    if is_fleet_recording(args.recordings[0]):
        raise BadConfiguration(
            f"{args.recordings[0]}: this is the recording of a fleet",
            hint="serve the recording of one of its robots",
        )
    with open_timeline(args.recordings) as timeline:
        yield lambda: Playback(timeline, args.recordings)


def _serve(server: Server, args: argparse.Namespace, address: Address, guard: Guard) -> int:
    import asyncio
    import logging

    secured = _tls(args)
    # The library would log each connection.
    logging.getLogger("websockets").setLevel(logging.WARNING)
    try:
        say = partial(_say, address, guard, args.tokens, secured is not None)
        asyncio.run(server.run(address, secured, ready=say))
    except OSError as error:
        why = f"--listen: cannot listen at {address.shown}: {error.strerror or error}"
        print(one_line(f"fasaco-edge: {why}"), file=sys.stderr)
        print("  hint: give --listen another port, or an address of this computer", file=sys.stderr)
        return Exit.ERROR
    return Exit.OK


def _tls(args: argparse.Namespace) -> ssl.SSLContext | None:
    certificate, key = args.certificate, args.private_key
    if certificate is None and key is None:
        return None
    if certificate is None or key is None:
        raise BadConfiguration("--certificate and --private-key go together")
    import ssl

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        why = f"{certificate}, {key}: {error.strerror or error}"
        raise BadConfiguration(f"--certificate, --private-key: {why}") from error
    return context


def _say(address: Address, guard: Guard, tokens: Path | None, secured: bool) -> None:
    page = f"{'https' if secured else 'http'}://{address.reached}/"
    if tokens is not None:
        print(f"page at {page} with the tokens in {one_line(str(tokens))}")
        if sys.stdout.isatty():
            # A link for each role, with its first token. A recording has only viewers.
            for role, token in dict(reversed(guard.tokens)).items():
                print(f"  {role}: {page}#{token}")
    else:
        # No punctuation follows the link: terminals would include it.
        print(f"page at {page} {'with commands' if guard.role == 'operator' else 'to look only'}")
    sys.stdout.flush()


COMMAND = Subcommand(
    description="Serve a web page that shows a robot's mission live: map, swept floor, path and "
    "robot, progress and what is left; where allowed, with commands, and zones drawn by hand. Or "
    "serve a recorded mission, with a time line. Several people may look at once. It runs on the "
    "robot or on any other machine of the bus.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
