"""Interpreters that have imported numba already, forked off a server: half a second less each.

They import nothing of the package before their code runs: which kernels, cache and settings they
have is up to that, as in an interpreter that was started.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import sys
import traceback
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path
from tempfile import TemporaryDirectory

OUTPUTS = ("out", "err")


@dataclass(frozen=True)
class Task:
    """What a forked interpreter does: its code, where, with which environment and umask.

    A umask of -1 leaves it as it is.
    """

    code: str
    folder: str
    environment: dict[str, str]
    umask: int


def run_forked(task: Task, timeout_s: float) -> tuple[int, str, str]:
    """Run ``task`` to its end; return its exit code, and what it said on both outputs."""
    with TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in OUTPUTS]
        process = start_server().Process(target=_run, args=(task, *map(str, files)))
        process.start()
        _join(process, timeout_s)
        return process.exitcode or 0, *(file.read_text() for file in files)


def start_server() -> ForkServerContext:
    """Return the server, started unless it runs; its socket is where temporary files are then."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["numba", "llvmlite.binding"])
    forkserver.ensure_running()
    return context


def _join(process: ForkServerProcess, timeout_s: float) -> None:
    process.join(timeout_s)
    if process.is_alive():
        process.kill()
        raise AssertionError(f"still there after {timeout_s} s")


def _run(task: Task, *outputs: str) -> None:
    """Become what ``python -c`` would be in that folder, with that environment."""
    assert not any(name.partition(".")[0] == "fasaco_edge" for name in sys.modules)
    for descriptor, file in enumerate(outputs, start=1):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600), descriptor)
    os.chdir(task.folder)
    if task.umask >= 0:
        os.umask(task.umask)
    os.environ.clear()
    os.environ.update(task.environment)
    ours = str(Path(__file__).parents[2])
    sys.path[:] = ["", *(entry for entry in sys.path if entry not in ("", ours))]
    sys.modules["numba"].core.config.reload_config()
    code = 1
    try:
        exec(task.code, {"__name__": "__main__"})
        code = 0
    except BaseException:
        traceback.print_exc()
    # Children of multiprocessing end without it.
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
