"""``fasaco-edge warmup``: compilation of the kernels into the cache."""

from __future__ import annotations

import argparse
import time
from collections.abc import Collection

from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_json
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import err, progress
from fasaco_edge.kernels import folder as kernels
from fasaco_edge.kernels.manifest import chosen_folder, why_missing
from fasaco_edge.planners.compiling import compile_missing
from fasaco_edge.planners.stages import STAGES

EPILOG = """\
The cache is $NUMBA_CACHE_DIR, else fasaco-edge in $XDG_CACHE_HOME or ~/.cache. Its code is for
these sources, one processor, and one version each of numba, llvmlite and Python. Without it a
daemon compiles the kernels at its first map. Each file is checked before use; a damaged file is
compiled again. If users other than root and you can write to the folder, or replace it, a temporary
folder is used instead: `chmod go-w` on the named folder corrects that. A relative $XDG_CACHE_HOME
is ignored; a user without a home gets a temporary folder, too.

exit codes: 0 all kernels are compiled, 1 (--check) some are missing

examples:
  fasaco-edge warmup
  fasaco-edge warmup --check || echo 'the first plan will be slow'
  NUMBA_CACHE_DIR=/var/cache/fasaco-edge/numba fasaco-edge warmup --prune
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--check",
        action="store_true",
        help="compile nothing, report whether all kernels are compiled",
    )
    parser.add_argument(
        "--prune", action="store_true", help="also remove kernels of other versions"
    )
    add_json(parser, "the result")


def run(args: argparse.Namespace) -> int:
    """Compile or check the kernels; print the result and their folder."""
    seconds = 0.0 if args.check else compile_kernels()
    folder, passed_over = chosen_folder(STAGES)
    missing = why_missing(folder, STAGES) if folder else "no folder can be used"
    folder = folder or kernels.wanted_folder()
    removed, freed_mb = kernels.prune(kernels.wanted_folder()) if args.prune else (0, 0.0)
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
        if passed_over and args.check:  # otherwise it is already logged
            err().print(f"{passed_over}: not used", soft_wrap=True)
        after = "" if args.check else f" after {seconds:.1f} s"
        # Kernels still missing after compilation could not be saved, which is already logged.
        ready = f"not ready: {missing};" if missing else f"ready{after}"
        to_do = ": `fasaco-edge warmup` compiles them" if missing and args.check else ""
        err().print(f"kernels {ready} in {folder}{to_do}", soft_wrap=True)
    if args.prune and not args.json:
        err().print(f"removed {removed} folders of other versions, {freed_mb} MB")
    return Exit.ERROR if missing and args.check else Exit.OK


def compile_kernels(stages: Collection[str] = STAGES) -> float:
    """Compile missing kernels of some stages with a progress bar; return the duration [s]."""
    started = time.monotonic()
    with progress() as bar:
        task = bar.add_task("checking the kernels", total=len(stages))
        places = {stage: place for place, stage in enumerate(stages)}

        def report(stage: str) -> None:
            text = f"compiling kernels (first run only): {stage}"
            bar.update(task, description=text, completed=places.get(stage))

        compile_missing(report, stages)
    return time.monotonic() - started


COMMAND = Subcommand(
    description="Compile the kernels into the cache, so that the first plan starts at once.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
