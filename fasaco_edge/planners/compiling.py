"""Kernel compiler: a process that compiles missing kernels, and restarts once it has grown.

Compiling takes up to a gigabyte of memory that is never released. So a process that needs kernels
starts this process, waits for it, and loads the compiled kernels. The compiler holds the lock of
the folder; once it has grown, it records the compiled stages and continues as a fresh process.
Kernels that are damaged, or that other users could have written, count as missing.

In parallel, a second compiler compiles the stages that share few kernels with the others. It writes
to its own folder, as two writers would damage numba's index of a function. When it has ended, the
first compiler takes over the functions that it has not compiled itself, and compiles the rest.
"""

from __future__ import annotations

import gc
import logging
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Self

from fasaco_edge.errors import ProcessEnded
from fasaco_edge.host.durable import make_folder
from fasaco_edge.host.processes import (
    available_memory,
    end_with_parent,
    python_program,
    resident_mb,
)
from fasaco_edge.kernels.folder import warn_of
from fasaco_edge.kernels.manifest import (
    UnsoundError,
    chosen_folder,
    cleared,
    compiling_into,
    record,
    remove,
    why_missing,
)
from fasaco_edge.planners.stages import APART, STAGES

LOG = logging.getLogger(__name__)

MODULE = "fasaco_edge.planners.compiling"
# The compiler restarts above MOST_MB of memory, unless PLENTY_MB are available: a third of the
# whole time is spent on restarts. With the daemon's 45 MB, MOST_MB fits the unit's limit
# (MemoryHigh=): a fifth of this memory is pages of libraries, which the system shares or reclaims.
MOST_MB, PLENTY_MB = 270.0, 2000.0
# Limit on restarts, in case a disk corrupts every file; 25 are usual.
MOST_RESTARTS = 300
# Least available memory for two compilers, of up to a gigabyte each [MB].
TWO_MB = 4000.0
# Thresholds of Python's garbage collection with plenty of memory, see gc.set_threshold: compiling
# takes a twentieth less processor time, and some 100 MB more.
RARELY = 50_000, 20, 50
# Argument that starts a second compiler, in place of the count of restarts.
APART_WORD = "apart"
# Lines that the process prints: one of these words, a tab and a text.
REASON, STAGE, WARNING = "reason", "stage", "warning"


def compile_missing(
    report: Callable[[str], None] = lambda _: None, stages: Collection[str] = STAGES
) -> None:
    """Compile the missing kernels of some stages in another process, and wait for it.

    Args:
        report: called with each stage's name before it begins.
        stages: names of stages.

    Raises:
        ProcessEnded: the process failed, or was killed.
    """
    if (process := CompilerProcess.start(stages)) is None:
        return
    try:
        for word, text in process.lines():
            if word == STAGE:
                report(text)
            else:
                LOG.info("compiling the kernels, which takes minutes: %s", text)
        process.check()
    finally:
        process.close()


def warm_up(
    report: Callable[[str], None] = lambda _: None, stages: Collection[str] = STAGES
) -> None:
    """Compile missing kernels in another process, then load all kernels of stages into this one.

    Args:
        report: called with each stage's name before it begins.
        stages: names of stages.
    """
    compile_missing(report, stages)
    # Imported only now, as the import chooses the folder of the kernels.
    from fasaco_edge.kernels.jit import pack_loaded  # noqa: PLC0415
    from fasaco_edge.planners.warmup import TinyRoom, run_stage  # noqa: PLC0415

    room = TinyRoom()
    for stage in stages:
        report(stage)
        run_stage(stage, room)
        pack_loaded()


class CompilerProcess:
    """The compiler process, as seen by the process that started it."""

    def __init__(self, folder: Path, stages: Collection[str]) -> None:
        self._process = subprocess.Popen(
            python_program(MODULE, str(folder), "0", *stages),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
        )

    @classmethod
    def start(cls, stages: Collection[str] = STAGES) -> CompilerProcess | None:
        """Start the compiler; None if nothing is missing, or no folder can be used (logged)."""
        if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
            return None  # kernels are not compiled
        folder, why = chosen_folder(stages)
        warn_of(why, folder)
        if folder is None or not why_missing(folder, stages):
            return None
        return cls(folder, stages)

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield stages and reasons until the compiler ends; log its warnings."""
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                word, _, text = line.rstrip("\n").partition("\t")
                if word == WARNING:
                    LOG.warning("%s", text)
                else:
                    yield word, text

    def has_ended(self) -> bool:
        """Return whether the compiler has ended."""
        return self._process.poll() is not None

    def check(self) -> None:
        """Wait for the compiler's end.

        Raises:
            ProcessEnded: it failed, or was killed.
        """
        if (code := self._process.wait()) != 0:
            raise ProcessEnded(
                f"the kernels were not compiled: the compiler {_ended(code)}",
                hint="check that 300 MB of memory are free, then try `fasaco-edge warmup`",
            )

    def close(self) -> None:
        """End the compiler; the compiled stages stay."""
        self._process.kill()
        self._process.wait()


def _ended(code: int) -> str:
    """Return how a process ended, in words."""
    if code >= 0:
        return f"ended with {code}"
    name = signal.Signals(-code).name
    return f"was killed by {name}" + (", probably out of memory" if name == "SIGKILL" else "")


def main() -> None:
    """Compile missing kernels; arguments: the folder, the number of restarts, and the stages."""
    place, restarts, *stages = sys.argv[1:]
    folder = Path(place)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.umask(0o077)
    end_with_parent(os.getppid())
    if restarts == APART_WORD:
        _compile_apart(folder, stages)
        return
    logging.basicConfig(level=logging.WARNING, handlers=[_ToStarter()])
    try:
        _compile(folder, int(restarts), stages)
    except UnsoundError as why:
        _say(WARNING, f"{why}: each process compiles its own kernels")
    except OSError as error:
        _say(
            WARNING,
            f"{folder} cannot be written: {error.strerror}: each process compiles its own kernels",
        )


def _compile(folder: Path, restarts: int, stages: list[str]) -> None:
    why = why_missing(folder, stages)

    def waiting() -> None:
        _say(STAGE, "another process is compiling them")

    with compiling_into(folder, waiting) as manifest:
        if not manifest.why_short_of(stages):
            return
        if not restarts:
            _say(REASON, why)
        from fasaco_edge.kernels.jit import compile_into  # noqa: PLC0415

        is_short = available_memory() < PLENTY_MB * 1e6
        if not is_short:
            gc.set_threshold(*RARELY)

        def stay_small(compiled: int) -> None:
            """Continue as a fresh process if this one has grown, and has compiled something."""
            if is_short and compiled and resident_mb() > MOST_MB and restarts < MOST_RESTARTS:
                record(folder, manifest)
                words = (str(folder), str(restarts + 1), *stages)
                os.execv(sys.executable, python_program(MODULE, *words))

        compile_into(folder, stay_small)
        from fasaco_edge.planners.warmup import TinyRoom, run_stage  # noqa: PLC0415

        room, missing = TinyRoom(), [stage for stage in stages if stage not in manifest.stages]
        try:
            with SecondCompiler(folder, missing) as second:
                for stage in missing:
                    _say(STAGE, stage)
                    if stage in second.stages:
                        second.hand_over()
                    run_stage(stage, room)
                    record(folder, manifest, stage)
        except OSError:
            cleared(folder)
            raise


def _compile_apart(folder: Path, stages: list[str]) -> None:
    from fasaco_edge.kernels.jit import compile_into  # noqa: PLC0415

    gc.set_threshold(*RARELY)
    compile_into(folder, lambda _: None)
    from fasaco_edge.planners.warmup import TinyRoom, run_stage  # noqa: PLC0415

    room = TinyRoom()
    for stage in stages:
        run_stage(stage, room)


class SecondCompiler:
    """The second compiler, as seen by the first; it may have nothing to compile.

    Attributes:
        stages: stages that it compiles.
    """

    def __init__(self, folder: Path, stages: Sequence[str]) -> None:
        apart = [stage for stage in stages if stage in APART]
        can_run = len(os.sched_getaffinity(0)) > 1 and available_memory() >= TWO_MB * 1e6
        self.stages = apart if can_run and len(apart) < len(stages) else []
        self._target, self._folder = folder, folder.with_name(f"{folder.name}.second")
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        remove(self._folder)
        if self.stages:
            make_folder(self._folder, mode=0o700)
            self._process = subprocess.Popen(
                python_program(MODULE, str(self._folder), APART_WORD, *self.stages),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    def hand_over(self) -> None:
        """Wait for the second compiler, and move the files of functions that only it has compiled.

        If it failed, nothing is moved, and the first compiler compiles all functions.

        Raises:
            OSError: a file cannot be moved.
        """
        process, self._process = self._process, None
        if process is None or process.wait() != 0:
            return
        there = {file.stem for file in self._target.glob("*.nbi")}
        for index in self._folder.glob("*.nbi"):
            if index.stem not in there:
                # The code is moved before the index that lists it.
                for file in (*self._folder.glob(f"{index.stem}.*.nbc"), index):
                    file.replace(self._target / file.name)


class _ToStarter(logging.Handler):
    """Passes log messages on to the process that started this one."""

    def emit(self, record: logging.LogRecord) -> None:
        _say(WARNING, record.getMessage())


def _say(word: str, text: str) -> None:
    print(f"{word}\t{' '.join(text.splitlines())}", flush=True)


if __name__ == "__main__":
    main()
