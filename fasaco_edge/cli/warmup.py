"""``fasaco-edge warmup``: compile the kernels into the cache."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fasaco_edge.cli.arguments import Subparsers


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "warmup",
        parents=[common],
        help="compile the kernels into the cache, so that the first plan starts at once",
        description="Compile the kernels into the cache, so that the first plan starts at once. "
        "NUMBA_CACHE_DIR moves the cache.",
    )
    parser.set_defaults(command=run)


def run(args: argparse.Namespace) -> int:
    """Compile, and say where to."""
    from fasaco_edge.cli.terminal import err

    seconds = compile_kernels()
    from fasaco_edge.kernels.jit import CACHE_FOLDER

    err().print(f"kernels ready after {seconds:.1f} s in {CACHE_FOLDER}")
    return 0


def compile_kernels() -> float:
    """Compile or load every kernel with a progress bar; return the seconds it took."""
    from fasaco_edge.cli.terminal import progress

    started = time.monotonic()
    with progress() as bar:
        task = bar.add_task("loading numba", total=None)
        from fasaco_edge.planners.warmup import STAGES, warm_up

        bar.update(task, total=len(STAGES), completed=-1)

        def report(stage: str) -> None:
            bar.update(task, description=f"compiling kernels (first run only): {stage}", advance=1)

        warm_up(report)
    return time.monotonic() - started
