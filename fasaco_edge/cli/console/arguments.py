"""A command: its description, its exit codes, and the arguments that several commands share.

A file that a command writes is checked before the work begins, so that none is done in vain.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fasaco_edge.bus import DEFAULT_ENDPOINT
from fasaco_edge.errors import BadConfiguration

if TYPE_CHECKING:
    from fasaco_edge.bus.settings import BusSettings
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.wire.keys import Keys

DEFAULT_CELL_M = 0.3
DEFAULT_RADIUS_M = 0.18
# Of the environment, for who gives the same options all day.
ROBOT, CONNECT = "FASACO_ROBOT", "FASACO_CONNECT"


class Exit(IntEnum):
    """Exit codes of commands."""

    OK = 0
    ERROR = 1
    CONFIG = 78  # EX_CONFIG of sysexits.h: a service must not be started again
    INTERRUPTED = 130  # 128 + SIGINT, as a shell tells it


def add_nothing(parser: argparse.ArgumentParser) -> None:
    """Declare no options."""


@dataclass(frozen=True, slots=True)
class Command:
    """One command of ``fasaco-edge``.

    Attributes:
        description: what ``--help`` begins with.
        run: carries it out, and returns the exit code.
        add_options: declares the options it takes.
        epilog: what ``--help`` ends with, printed as it stands.
        is_group: whether it has commands of its own, which take the common options in its place.
    """

    description: str
    run: Callable[[argparse.Namespace], int]
    add_options: Callable[[argparse.ArgumentParser], None] = add_nothing
    epilog: str | None = None
    is_group: bool = False


def add_common(parser: argparse.ArgumentParser) -> None:
    """Add the options that all commands take."""
    parser.add_argument(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        default="info",
        help="log level on standard error (default: %(default)s)",
    )
    # For the processes that other commands start: they end when those do.
    parser.add_argument("--with-parent", type=int, metavar="PID", help=argparse.SUPPRESS)


def add_json(parser: argparse._ActionsContainer, what: str) -> None:
    """Add ``--json``, which prints ``what`` as JSON."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as JSON")


def pair_of_ints(text: str) -> tuple[int, int]:
    """Read ``R,C``."""
    try:
        row, col = (int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be row,column, got {text!r}") from None
    return row, col


def pair_of_floats(text: str) -> tuple[float, float]:
    """Read ``X,Y``."""
    from fasaco_edge.wire.limits import MAX_COORDINATE_M

    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be x,y in metres, got {text!r}") from None
    # A negated comparison, so that NaN is caught too.
    if not (abs(x) <= MAX_COORDINATE_M and abs(y) <= MAX_COORDINATE_M):
        raise argparse.ArgumentTypeError(f"must be within {MAX_COORDINATE_M:g} m of 0, got {text}")
    return x, y


def seconds(text: str) -> float:
    """Read a time to wait [s]."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    # A negated comparison, so that NaN is caught too.
    if not 0 < value <= 3600:
        raise argparse.ArgumentTypeError(f"must be in (0, 3600] s, got {text!r}")
    return value


def with_negative_pairs(words: Sequence[str]) -> list[str]:
    """Return the words of a command line with ``--start -1,2`` as ``--start=-1,2``.

    argparse takes negative numbers for values, but ``-1,2`` for an option.
    """
    joined: list[str] = []
    for word in words:
        if (
            joined
            and joined[-1] in ("--start", "--start-xy", "--end", "--keep-out", "--point")
            and re.match(r"-[\d.]", word)
        ):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def add_robot_on_bus(parser: argparse.ArgumentParser, *, config: bool = True) -> None:
    """Add what names a robot on the bus and how to get there; read it by ``robot_on_bus``.

    ``config``: also ``--config``, where a command has none of its own.
    """
    if config:
        parser.add_argument(
            "--config",
            type=Path,
            metavar="FILE",
            help="the daemon's YAML configuration: robot, bus and credentials come from it, where "
            "no option says otherwise",
        )
    parser.add_argument(
        "--robot", metavar="NAME", help=f"name of the robot (default: ${ROBOT}, else robot)"
    )
    parser.add_argument("--base", metavar="KEY", help="prefix of all keys (default: fasaco)")
    parser.add_argument(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help="Zenoh endpoint to connect to; may be repeated "
        f"(default: ${CONNECT}, several apart by commas, else {DEFAULT_ENDPOINT})",
    )
    parser.add_argument(
        "--security",
        metavar="FILE",
        help="YAML file with this client's credentials, if the bus requires them: `kind: tls` "
        "with `tls: {root_ca: ..., certificate: ..., private_key: ...}`, or `kind: user` with "
        "`user: {name: ..., password_file: ...}`",
    )


class RobotOnBus(NamedTuple):
    """A robot on the bus, and the session that a client of it opens.

    Attributes:
        keys: the robot's keys.
        bus: how to join its bus.
        config: of ``--config``; None without.
    """

    keys: Keys
    bus: BusSettings
    config: DaemonConfig | None = None


def robot_on_bus(args: argparse.Namespace) -> RobotOnBus:
    """Return what the options of ``add_robot_on_bus`` say; else ``--config``, the environment,
    the defaults, in this order.

    Raises:
        BadConfiguration: a name is none, or the configuration or what shows who this is cannot be
            read.
    """
    from fasaco_edge.wire.keys import Keys

    file = getattr(args, "config", None)
    if file is not None:
        from fasaco_edge.config.loading import load_config

        config = load_config(file)
        keys = Keys(args.robot or config.robot.name, args.base or config.bus.base)
        bus = config.bus.of_client()
        if args.connect or args.security:
            bus = _client(tuple(args.connect or bus.connect), args.security)
        return RobotOnBus(keys, bus, config)
    keys = Keys(args.robot or os.environ.get(ROBOT) or "robot", args.base or "fasaco")
    told = [one.strip() for one in os.environ.get(CONNECT, "").split(",") if one.strip()]
    connect = tuple(args.connect or told or (DEFAULT_ENDPOINT,))
    return RobotOnBus(keys, _client(connect, args.security))


def _client(connect: tuple[str, ...], security_file: str | None) -> BusSettings:
    from fasaco_edge.bus.settings import BusSettings

    if security_file is None:
        return BusSettings("client", connect)
    from fasaco_edge.config.security import read_client_security

    security = read_client_security(security_file, connect)
    security.warn_of_clock()
    return BusSettings("client", connect, secured=security.of_client())


def check_output(file: Path | None) -> None:
    """Check that ``file`` can be written; None is no file at all.

    Raises:
        BadConfiguration: it is a folder, its folder is missing, or neither may be written to.
    """
    if file is None:
        return
    if file.is_dir():
        raise _unwritable(file, "that is a folder")
    if not file.parent.is_dir():
        raise _unwritable(file, f"there is no folder {file.parent}")
    if not os.access(file if file.exists() else file.parent, os.W_OK):
        raise _unwritable(file, "no permission")


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """Name ``file`` where the block fails to write it, on a full disk, say.

    Raises:
        BadConfiguration: the block raised OSError.
    """
    try:
        yield
    except OSError as error:
        raise _unwritable(file, error.strerror or str(error)) from error


def _unwritable(file: Path, why: str) -> BadConfiguration:
    return BadConfiguration(
        f"cannot write {file}: {why}", hint="name a place that exists and can be written to"
    )
