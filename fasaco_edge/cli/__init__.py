"""The command line: ``fasaco-edge`` and its commands, one module or package each.

The module of a command defines ``COMMAND``, and ``COMMANDS`` has a row for it. Only the module of
the given command is imported.
"""

from __future__ import annotations

import argparse
import errno
import logging
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from fasaco_edge import __version__
from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_common
from fasaco_edge.cli.console.logs import begin_logging, report_error
from fasaco_edge.cli.console.parser import Parser
from fasaco_edge.cli.console.streams import clean_streams, open_missing_streams
from fasaco_edge.errors import BadConfiguration, DiskFailed, FasacoError, PlannerFailed
from fasaco_edge.host.processes import end_with_parent

COMMANDS = {
    "demo": "watch a simulated robot map and cover a building",
    "plan": "plan a coverage path offline",
    "init": "write a first configuration from some answers, and test it on the bus",
    "run": "run the daemon: maps come in over Zenoh, paths go out",
    "follow": "drive a robot's base along the path, by velocities 20 times a second",
    "mission": "command a running daemon: start, pause, resume, home, cancel, replan, status ...",
    "rooms": "list, name, split, merge and set the rooms found by a running daemon",
    "ask": "query a running daemon: status, path, coverage, pheromone, config, replan ...",
    "watch": "watch a robot's mission live in this terminal",
    "serve": "show a robot's mission as a web page, also on phones",
    "record": "record a robot's mission into a Rerun recording (.rrd)",
    "review": "report what happened in a recorded mission",
    "replay": "replay a recorded mission and compare its decisions",
    "simulate": "simulate a robot with a laser scanner on the bus",
    "bench": "compare planners; measure a daemon's memory, load and delays on this machine",
    "maps": "list the maps that come with the package",
    "warmup": "compile the kernels into the cache, so that the first plan starts at once",
    "check-config": "check a configuration: each fault with line, value and what is allowed",
    "doctor": "check host, bus and configuration, and say what to do",
}
"""Each command, and its line in ``fasaco-edge --help``."""

# Errors of a faulty or full disk, or of exhausted memory or file descriptors. Their exit code makes
# systemd restart a service; the exit code of an invalid configuration does not.
_TRANSIENT = frozenset(
    (errno.EIO, errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ESTALE)
)

_OUT_OF_MEMORY = (
    "end other programs, or raise the limits: ulimit -a; MemoryMax=, TasksMax= of a unit"
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return the process's exit code."""
    words = sys.argv[1:] if argv is None else argv
    return run_command(_parser(words), words)


def program() -> NoReturn:
    """Run one command as the process's only task, and exit with the command's code.

    After a Zenoh session is closed, its threads still release callbacks for a while (Zenoh 1.10). A
    shutdown of the interpreter in that time may abort with "FATAL: exception not rethrown", or
    hang. So the process exits without a shutdown, unless Rerun is loaded, which writes its last
    data during the shutdown. A hanging check of ``doctor`` cannot delay the exit either.
    """
    code = main()
    if "zenoh" not in sys.modules or "rerun" in sys.modules:
        sys.exit(code)
    logging.shutdown()
    try:
        sys.stdout.flush()
    except OSError:
        code = code or Exit.ERROR
    os._exit(code)


def run_command(parser: Parser, words: Sequence[str]) -> int:
    """Run the command that ``parser`` finds in ``words``; report errors; return the exit code."""
    # No other user may change the files written here.
    os.umask(os.umask(0o022) | 0o022)
    open_missing_streams()
    clean_streams()
    args, unknown = parser.parse_known_args(words)
    if unknown:
        args.parser.refuse(unknown)
    begin_logging(args.log_level)
    if args.with_parent is not None:
        end_with_parent(args.with_parent)
    try:
        code: int = args.command(args)
    except FasacoError as error:
        return _fail(DiskFailed(str(error)) if _is_transient(error) else error)
    except KeyboardInterrupt:
        return Exit.INTERRUPTED
    except SystemError as error:
        # Numba raises this for Ctrl-C while a kernel runs.
        if isinstance(error.__cause__, KeyboardInterrupt):
            return Exit.INTERRUPTED
        raise
    except BrokenPipeError:
        # The reader has closed the pipe (``| head``); the interpreter must not flush to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Exit.ERROR
    except (OSError, MemoryError, RuntimeError) as error:
        if not _is_transient(error):
            raise
        return _fail(_transient(error))
    return code


def _parser(words: Sequence[str]) -> Parser:
    """Return a parser with all commands, and the options of the command in ``words``."""
    parser = Parser(
        prog="fasaco-edge",
        description="Coverage path planning for robots, with fast-spanning ant colonies.",
        epilog="Begin with `fasaco-edge demo`. Each command has --help.",
    )
    parser.add_argument("--version", action="version", version=f"fasaco-edge {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    first = next((word for word in words if not word.startswith("-")), "")
    for name, about in COMMANDS.items():
        described = commands.add_parser(name, help=about)
        if name == first:
            module = import_module(f"fasaco_edge.cli.{name.replace('-', '_')}")
            _describe(described, module.COMMAND)
    return parser


def _describe(parser: argparse.ArgumentParser, command: Subcommand) -> None:
    parser.description, parser.epilog = command.description, command.epilog
    parser.set_defaults(command=command.run)
    if not command.is_group:
        add_common(parser)
    command.add_options(parser)


def _is_transient(error: BaseException | None) -> bool:
    """Return whether an error may end by itself, and is not a mistake of the user."""
    # Errors of a user's own planner are the user's.
    while error is not None and not isinstance(error, PlannerFailed):
        if isinstance(error, OSError) and error.errno in _TRANSIENT:
            return True
        if isinstance(error, MemoryError) or "can't start new thread" in str(error):
            return True
        error = error.__cause__
    return False


def _transient(error: OSError | MemoryError | RuntimeError) -> DiskFailed:
    if isinstance(error, OSError):
        return DiskFailed(": ".join(filter(None, (error.filename, error.strerror))))
    return DiskFailed("out of memory or threads", hint=_OUT_OF_MEMORY)


def _fail(error: FasacoError) -> int:
    report_error(error)
    return Exit.CONFIG if isinstance(error, BadConfiguration) else Exit.ERROR
