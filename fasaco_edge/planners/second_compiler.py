"""Second compiler: a process that compiles some stages at the same time, in a folder of its own.

Compiling takes minutes on one core. Stages that share few kernels with the others are compiled
here meanwhile. One process alone writes the folder of the kernels, as numba's index of a function
goes wrong where two write it: so the first compiler moves the files of functions that it has not
compiled itself, and compiles what is still missing.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from fasaco_edge.host.durable import make_folder
from fasaco_edge.host.processes import available_memory, end_with_parent, python_program
from fasaco_edge.kernels.manifest import remove
from fasaco_edge.planners.stages import APART

MODULE = "fasaco_edge.planners.second_compiler"
# Available memory from which two compilers run: each takes up to a gigabyte [MB].
TWO_MB = 4000.0


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
                python_program(MODULE, str(self._folder), *self.stages),
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
        """Wait for its end, and move what it has compiled and the first compiler has not.

        If it failed, nothing is moved: the first compiler compiles all.

        Raises:
            OSError: a file cannot be moved.
        """
        process, self._process = self._process, None
        if process is None or process.wait() != 0:
            return
        there = {file.stem for file in self._target.glob("*.nbi")}
        for index in self._folder.glob("*.nbi"):
            if index.stem not in there:
                # Code before the index that lists it.
                for file in (*self._folder.glob(f"{index.stem}.*.nbc"), index):
                    file.replace(self._target / file.name)


def main() -> None:
    """Compile stages into a folder: its path, and the stages."""
    place, *stages = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.umask(0o077)
    end_with_parent(os.getppid())
    from fasaco_edge.kernels.jit import compile_into  # noqa: PLC0415

    compile_into(Path(place), lambda _: None)
    from fasaco_edge.planners.warmup import TinyRoom, run_stage  # noqa: PLC0415

    room = TinyRoom()
    for stage in stages:
        run_stage(stage, room)


if __name__ == "__main__":
    main()
