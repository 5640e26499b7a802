"""``fasaco-edge warmup``: compilation of the kernels into the cache."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from fasaco_edge.cli.console.arguments import Command, Exit, add_json
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import err, progress
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.processes import available_memory, end_with_parent, python_program
from fasaco_edge.kernels import cache, release

# The compiler has 930 MB in the end.
TWO_NEED_BYTES = 2_000_000_000
EPILOG = """\
An installation from a release folder ships compiled kernels and compiles nothing, as long as
they are intact and numba, llvmlite and Python have the versions they were made for.

The cache is $NUMBA_CACHE_DIR, else fasaco-edge in $XDG_CACHE_HOME or ~/.cache. Its code is for
these sources, one version each of numba, llvmlite and Python, and one processor; a daemon that
finds none compiles it with its first map. Each file is checked before use; a damaged one is
compiled again. A folder that anybody but root and you could write to or replace is not used, but
a temporary one instead: `chmod go-w` on the named folder mends that. A relative $XDG_CACHE_HOME is
ignored; a user without a home gets the temporary folder, too.
exit codes: 0 all kernels are there, 1 (--check) some are not

examples:
  fasaco-edge warmup
  fasaco-edge warmup --check || echo 'the first plan will be slow'
  NUMBA_CACHE_DIR=/var/cache/fasaco-edge/numba fasaco-edge warmup --prune
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--check", action="store_true", help="compile nothing, report whether all kernels are there"
    )
    parser.add_argument(
        "--prune", action="store_true", help="then remove kernels of other versions"
    )
    parser.add_argument(
        "--for-release",
        type=Path,
        metavar="DIR",
        help="compile for any processor of this architecture into DIR, to ship with a release",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        choices=(1, 2),
        metavar="N",
        help="processes that compile (default: 2 where there are two cores and 2 GB to spare)",
    )
    # The second of two processes: the last stage first.
    parser.add_argument("--backward", action="store_true", help=argparse.SUPPRESS)
    add_json(parser, "the result")


def run(args: argparse.Namespace) -> int:
    """Compile or check, and say where."""
    if args.for_release is not None:
        return compile_for_release(args.for_release)
    if args.backward:
        end_with_parent(os.getppid())
        compile_all(backward=True)
        return Exit.OK
    seconds = 0.0 if args.check else compile_kernels(args.jobs)
    folder, passed_over = cache.usable_folder()
    missing = cache.missing_from(folder)
    removed, freed_mb = cache.prune(cache.wanted_folder()) if args.prune else (0, 0.0)
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


def compile_kernels(jobs: int | None = None) -> float:
    """Compile or load every kernel with a progress bar; return the seconds it took.

    Args:
        jobs: processes that compile; without it two, where there is room for them.
    """
    started = time.monotonic()
    folder = cache.cache_folder()
    has_work = folder is not None and bool(cache.missing_from(folder))
    if jobs is None:
        jobs = 2 if has_work and _has_room_for_two() else 1
    with _from_the_end(folder) if jobs == 2 and folder else nullcontext():
        compile_all()
    return time.monotonic() - started


def _has_room_for_two() -> bool:
    return len(os.sched_getaffinity(0)) > 1 and available_memory() >= TWO_NEED_BYTES


@contextmanager
def _from_the_end(folder: Path) -> Iterator[None]:
    """Let another process compile from the last stage on; each loads the other's kernels.

    Nothing depends on it: what it leaves over this process compiles.
    """
    other = subprocess.Popen(
        python_program("fasaco_edge", "warmup", "--backward"),
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield
    finally:
        # The stages that are left to it are compiled. Killed, it leaves no file that counts.
        other.terminate()
        other.wait()


def compile_all(*, backward: bool = False) -> None:
    """Compile or load every kernel with a progress bar; ``backward``: the last stage first."""
    with progress() as bar:
        task = bar.add_task("loading numba", total=None)
        from fasaco_edge.planners.warmup import STAGES, warm_up

        bar.update(task, total=len(STAGES), completed=-1)

        def report(stage: str) -> None:
            bar.update(task, description=f"compiling kernels (first run only): {stage}", advance=1)

        warm_up(report, backward=backward)


def compile_for_release(folder: Path) -> int:
    """Compile every kernel for any processor of this kind; put them and their manifest there."""
    if release.has_kernels():
        raise BadConfiguration(
            f"--for-release {folder}: this installation has its kernels from a release itself",
            hint=f"copy {release.FOLDER}",
        )
    folder.mkdir(parents=True, exist_ok=True)
    if left := next(folder.iterdir(), None):
        raise BadConfiguration(
            f"--for-release {folder} is not empty: {left.name}", hint="name a new folder"
        )
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        environment = os.environ | release.FOR_ANY_PROCESSOR | {"NUMBA_CACHE_DIR": scratch}
        # By one process: names in the code count what it has compiled before.
        words = ("warmup", "--jobs", "1")
        subprocess.run(python_program("fasaco_edge", *words), env=environment, check=True)
        for file in sorted(Path(scratch).rglob(f"*{release.KERNEL_SUFFIX}")):
            shutil.move(file, folder)
    count = release.write_manifest(folder)
    err().print(f"{count} compiled kernels and {release.MANIFEST} in {folder}", soft_wrap=True)
    return Exit.OK


COMMAND = Command(
    description="Compile the kernels into the cache, so that the first plan starts at once.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
