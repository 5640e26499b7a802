"""The command line: ``fasaco-edge`` and its commands, one file each."""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Sequence

from fasaco_edge import __version__
from fasaco_edge.cli import (
    ask,
    bench,
    check_config,
    demo,
    doctor,
    maps,
    mission,
    plan,
    record,
    replay,
    review,
    run,
    simulate,
    warmup,
    watch,
)
from fasaco_edge.cli.console import exits
from fasaco_edge.cli.console.arguments import with_negative_pairs
from fasaco_edge.cli.console.logs import begin_logging, say_why
from fasaco_edge.cli.console.streams import clean_streams
from fasaco_edge.errors import BadConfiguration, DiskFailed, FasacoError
from fasaco_edge.host.signals import end_with_parent

COMMANDS = (
    demo, plan, run, mission, ask, watch, record, review, replay, simulate, bench, maps, warmup,
    check_config, doctor,
)  # fmt: skip

# A broken or full disk, a computer that is out of files or memory. Who is told so does not look
# for a mistake in the configuration, and a service is started again.
_PASSING = frozenset(
    (errno.EIO, errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ESTALE)
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return the process's exit code."""
    return run_command(_parser(), sys.argv[1:] if argv is None else argv)


def run_command(parser: argparse.ArgumentParser, words: Sequence[str]) -> int:
    """Run the command that ``parser`` finds in ``words``; each error is told, and is a code."""
    # Whatever the caller's mask is: what is written here, no other user may change.
    os.umask(os.umask(0o022) | 0o022)
    clean_streams()
    args = parser.parse_args(with_negative_pairs(words))
    begin_logging(args.log_level)
    if args.with_parent is not None:
        end_with_parent(args.with_parent)
    try:
        code: int = args.command(args)
    except FasacoError as error:
        return _fail(DiskFailed(str(error)) if _may_pass(error) else error)
    except KeyboardInterrupt:
        return exits.INTERRUPTED
    except SystemError as error:
        # What numba makes of Ctrl-C while a kernel runs.
        if isinstance(error.__cause__, KeyboardInterrupt):
            return exits.INTERRUPTED
        raise
    except BrokenPipeError:
        # The reader has seen enough (``| head``); nothing is left to be flushed to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return exits.ERROR
    except OSError as error:
        if not _may_pass(error):
            raise
        return _fail(DiskFailed(": ".join(filter(None, (error.filename, error.strerror)))))
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fasaco-edge",
        description="Coverage path planning with fast-spanning ant colonies, on a robot.",
        epilog="Begin with `fasaco-edge demo`. Each command explains itself with --help.",
    )
    parser.add_argument("--version", action="version", version=f"fasaco-edge {__version__}")
    common = common_options()
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for module in COMMANDS:
        module.add_to(commands, common)
    return parser


def common_options() -> argparse.ArgumentParser:
    """Return a parser of the options that all commands take."""
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        default="info",
        help="how much to say on standard error (default: %(default)s)",
    )
    # For the processes that other commands start: they end when those do.
    common.add_argument("--with-parent", type=int, metavar="PID", help=argparse.SUPPRESS)
    return common


def _may_pass(error: BaseException | None) -> bool:
    """Tell whether what is behind an error is no mistake of anybody's, and may be over soon."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _PASSING:
            return True
        error = error.__cause__
    return False


def _fail(error: FasacoError) -> int:
    say_why(error)
    return exits.CONFIG if isinstance(error, BadConfiguration) else exits.ERROR
