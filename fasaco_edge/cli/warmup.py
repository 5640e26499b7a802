"""``fasaco-edge warmup``: compile the kernels into the cache."""

from __future__ import annotations

import argparse
import time

from fasaco_edge.cli.console.arguments import Command, Exit, add_json
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import err, progress
from fasaco_edge.kernels import cache

EPILOG = """\
The cache is $NUMBA_CACHE_DIR, else fasaco-edge in $XDG_CACHE_HOME or ~/.cache. Code in it is for
these very sources, for one numba, llvmlite and Python, and for one processor; a daemon that finds
none compiles it itself, with its first map. Each file is checked before it is used: one that is
damaged is compiled again. A folder that others than root and you may write, or could put another
in place of, is not used, but a temporary one: `chmod go-w` on what is named mends that. A relative
$XDG_CACHE_HOME counts as none; a user without a home has the temporary folder, too.
exit codes: 0 all is there, 1 (--check) it is not

examples:
  fasaco-edge warmup
  fasaco-edge warmup --check || echo 'the first plan will take its time'
  NUMBA_CACHE_DIR=/var/cache/fasaco-edge/numba fasaco-edge warmup --prune
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--check", action="store_true", help="compile nothing, tell whether all is there"
    )
    parser.add_argument(
        "--prune", action="store_true", help="then remove what other versions have left there"
    )
    add_json(parser, "the result")


def run(args: argparse.Namespace) -> int:
    """Compile or check, and say where."""
    seconds = 0.0 if args.check else compile_kernels()
    folder, passed_over = cache.usable_folder()
    missing = cache.missing_from(folder)
    removed, freed_mb = cache.prune(folder) if args.prune else (0, 0.0)
    if args.json:
        document = {
            "ready": not missing,
            "folder": str(folder),
            "missing": missing,
            "passed_over": passed_over,
            "seconds": round(seconds, 3),
            "removed": removed,
            "freed_mb": freed_mb,
        }
        print_json(document)
    else:
        if passed_over and args.check:  # or else it has been logged
            err().print(f"{passed_over}: not used", soft_wrap=True)
        after = "" if args.check else f" after {seconds:.1f} s"
        # Not ready after a run that compiled them: they could not be kept, which has been logged.
        ready = f"not ready: {missing};" if missing else f"ready{after}"
        to_do = ": `fasaco-edge warmup` compiles them" if missing and args.check else ""
        err().print(f"kernels {ready} in {folder}{to_do}", soft_wrap=True)
    if args.prune and not args.json:
        err().print(f"removed {removed} folders of other versions, {freed_mb} MB")
    return Exit.ERROR if missing and args.check else Exit.OK


def compile_kernels() -> float:
    """Compile or load every kernel with a progress bar; return the seconds it took."""
    started = time.monotonic()
    with progress() as bar:
        task = bar.add_task("loading numba", total=None)
        from fasaco_edge.planners.warmup import STAGES, warm_up

        bar.update(task, total=len(STAGES), completed=-1)

        def report(stage: str) -> None:
            bar.update(task, description=f"compiling kernels (first run only): {stage}", advance=1)

        warm_up(report)
    return time.monotonic() - started


COMMAND = Command(
    description="Compile the kernels into the cache, so that the first plan starts at once.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
