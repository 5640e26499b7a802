"""The description of a command, exit codes, arguments that several commands share, output files.

Output files are checked before the work begins, so that no work is lost.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fasaco_edge.bus import DEFAULT_ENDPOINT
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.durable import whole

if TYPE_CHECKING:
    from fasaco_edge.bus.settings import BusSettings
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.wire.keys import Keys

DEFAULT_CELL_M = 0.3
DEFAULT_RADIUS_M = 0.18
# Environment variables that set the defaults of --robot and --connect.
ROBOT, CONNECT = "FASACO_ROBOT", "FASACO_CONNECT"


class Exit(IntEnum):
    """Exit codes of commands."""

    OK = 0
    ERROR = 1
    CONFIG = 78  # EX_CONFIG of sysexits.h: a service must not be started again
    INTERRUPTED = 130  # 128 + SIGINT, as in a shell


def add_nothing(parser: argparse.ArgumentParser) -> None:
    """Declare no options."""


@dataclass(frozen=True, slots=True)
class Subcommand:
    """One command of ``fasaco-edge``.

    Attributes:
        description: text at the start of ``--help``.
        run: runs the command, and returns the exit code.
        add_options: declares the options of the command.
        epilog: text at the end of ``--help``.
        is_group: whether the command has subcommands, each of which takes the common options.
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
        metavar="LEVEL",
        help="log on standard error: debug, info, warning or error (default: %(default)s)",
    )
    # For processes that other commands start, so that they end with their parent.
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
    # The comparison is negated to catch NaN.
    if not (abs(x) <= MAX_COORDINATE_M and abs(y) <= MAX_COORDINATE_M):
        raise argparse.ArgumentTypeError(f"must be within {MAX_COORDINATE_M:g} m of 0, got {text}")
    return x, y


def fleet_name(text: str) -> str:
    """Read the name of a fleet, as ``fleet.name`` of a configuration."""
    from fasaco_edge.config.config import FleetConfig
    from fasaco_edge.host.documents import inspected

    for fault in inspected(FleetConfig, {"name": text}, BadConfiguration)[1]:
        raise argparse.ArgumentTypeError(fault.what)
    return text


def seconds(least: float = 0.0, most: float = 3600.0) -> Callable[[str], float]:
    """Return a reader of a time above ``least``, up to ``most`` [s]."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = least
        # The comparison is negated to catch NaN.
        if not least < value <= most:
            raise argparse.ArgumentTypeError(f"must be in ({least:g}, {most:g}] s, got {text!r}")
        return value

    return read


def add_robot_on_bus(parser: argparse.ArgumentParser, *, config: bool = True) -> None:
    """Add the options for a robot and its bus, which ``robot_on_bus`` reads.

    ``config``: whether to add ``--config``, too; False for a command with its own.
    """
    if config:
        parser.add_argument(
            "--config",
            type=Path,
            metavar="FILE",
            help="the daemon's YAML configuration, for robot, bus and credentials; options here "
            "take precedence",
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
        f"(default: ${CONNECT}, with commas between several, else {DEFAULT_ENDPOINT})",
    )
    parser.add_argument(
        "--security",
        metavar="FILE",
        help="YAML file with this client's credentials, if the bus requires them: `kind: tls` "
        "with `tls: {root_ca: ..., certificate: ..., private_key: ...}`, or `kind: user` with "
        "`user: {name: ..., password_file: ...}`",
    )


class RobotOnBus(NamedTuple):
    """A robot on the bus, and the settings of its client's session.

    Attributes:
        keys: keys of the robot.
        bus: settings of the session.
        config: configuration given by ``--config``; None for none.
    """

    keys: Keys
    bus: BusSettings
    config: DaemonConfig | None = None


def robot_on_bus(args: argparse.Namespace) -> RobotOnBus:
    """Return robot and bus from options, ``--config``, environment or defaults, in this order.

    Raises:
        BadConfiguration: a name or an endpoint is invalid, or the configuration or the credentials
            cannot be read.
    """
    from fasaco_edge.wire.keys import Keys

    file = getattr(args, "config", None)
    if file is not None:
        from fasaco_edge.config.loading import load_config

        config = load_config(file)
        keys = Keys(args.robot or config.robot.name, args.base or config.bus.base)
        bus = config.bus.of_client()
        if args.connect or args.security:
            bus = _client("--connect", tuple(args.connect or bus.connect), args.security)
        return RobotOnBus(keys, bus, config)
    keys = Keys(args.robot or os.environ.get(ROBOT) or "robot", args.base or "fasaco")
    listed = [one.strip() for one in os.environ.get(CONNECT, "").split(",") if one.strip()]
    connect = tuple(args.connect or listed or (DEFAULT_ENDPOINT,))
    name = "--connect" if args.connect else f"${CONNECT}"
    return RobotOnBus(keys, _client(name, connect, args.security))


def _client(name: str, connect: tuple[str, ...], security_file: str | None) -> BusSettings:
    """Return the settings of a client; ``name``: source of the endpoints, for errors."""
    from fasaco_edge.bus.settings import BusSettings
    from fasaco_edge.config.endpoints import endpoint_faults

    for fault in endpoint_faults(name, connect):
        raise BadConfiguration(f"{name}: {fault.what}", hint=fault.hint)
    if security_file is None:
        return BusSettings("client", connect)
    from fasaco_edge.config.security import read_client_security

    security = read_client_security(security_file, connect)
    security.warn_of_certificate()
    return BusSettings("client", connect, secured=security.of_client())


def check_outputs(outputs: Iterable[Path | None], inputs: Iterable[Path] = ()) -> None:
    """Check that files can be written.

    Args:
        outputs: files to write; None is skipped.
        inputs: files to read, which must not be overwritten.

    Raises:
        BadConfiguration: a file is a folder, its folder is missing or not writable, it is also an
            input, or two outputs are the same.
    """
    # The methods of Path raise for invalid names, the functions of os.path do not.
    taken = {os.path.realpath(file): "it is an input" for file in inputs}
    for file in filter(None, outputs):
        target = os.path.realpath(file)
        if os.path.isdir(target):
            raise _unwritable(file, "that is a folder")
        folder = os.path.dirname(target)
        if not os.path.isdir(folder):
            shown = folder if os.path.islink(file) else file.parent
            raise _unwritable(file, f"there is no folder {shown}")
        is_there = os.path.exists(target)
        if not os.access(target if is_there else folder, os.W_OK):
            raise _unwritable(file, "no permission")
        if target in taken:
            raise _unwritable(file, taken[target])
        if os.path.isfile(target) or not is_there:
            taken[target] = "another option writes it, too"


@contextmanager
def naming(place: Path) -> Iterator[None]:
    """Turn an OSError of the block into an error that names ``place``.

    Raises:
        BadConfiguration: the block raised OSError.
    """
    try:
        yield
    except FileExistsError as error:  # of mkdir
        raise _unwritable(place, f"{error.filename} is not a folder") from error
    except OSError as error:
        raise _unwritable(place, error.strerror or str(error)) from error


@contextmanager
def writing(file: Path) -> Iterator[Path]:
    """Yield a temporary name under which to write ``file``, see ``host.durable.whole``.

    Raises:
        BadConfiguration: the file cannot be written.
    """
    with naming(file), whole(file) as new:
        yield new


def _unwritable(file: Path, why: str) -> BadConfiguration:
    return BadConfiguration(
        f"cannot write {file}: {why}", hint="name a file or folder that can be written"
    )
