"""Installations of two small kernels, each run as a process of its own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from fasaco_edge import host
from fasaco_edge.kernels import cache, code_files, compiler, jit, release, sealed
from fasaco_edge.kernels.cache import note_complete
from fasaco_edge.kernels.release import KERNEL_SUFFIX
from tests.kernels.harm import kernel_files
from tests.support.forked import run_forked

KERNELS = """
import json
import logging

# Before anything can be logged.
logging.basicConfig(handlers=[handler := logging.Handler()])
said = []
handler.emit = lambda record: said.append(record.getMessage())

from fasaco_edge.kernels import cache, code_files, jit

more = []

@jit.kernel
def seven(x):
    return 7 * x

@jit.kernel
def eight(x):
    return seven(x) + x

def tell(x=1, note=True):
    folder, passed_over = cache.usable_folder()
    missing = cache.missing_from(folder)
    assert eight(x) == 8 * x
    if note:
        code_files.note_all_compiled()
    stats = [seven.stats, eight.stats, *more]
    loaded, compiled = (
        sum(sum(getattr(stat, kind).values()) for stat in stats)
        for kind in ("cache_hits", "cache_misses")
    )
    place = (folder := code_files.kernel_folder()) and str(folder)
    print(json.dumps([missing, passed_over, loaded, compiled, said, place]))
"""


@dataclass(frozen=True)
class Told:
    """What a process found, and what it did: how many kernels it loaded and compiled."""

    missing: str
    passed_over: str
    loaded: int
    compiled: int
    warnings: list[str]
    folder: str | None


PATIENCE_S = 300.0
# The one that is called by the other is linked into it, and not loaded.
ALL_LOADED = (1, 0, [])


class Installation:
    """A package of two kernels, beside a cache."""

    def __init__(self, root: Path, cache: Path) -> None:
        self.root, self.cache = root, cache
        self.package = root / "fasaco_edge" / "kernels"
        if not root.exists():
            package_in(root)
            (self.package / "seven.py").write_text(KERNELS)

    def copy_to(self, folder: Path) -> Installation:
        """Return a copy of it, and of its cache as it is, in another folder."""
        for place in (self.root, self.cache):
            shutil.copytree(place, folder / place.name)
        return Installation(folder / self.root.name, folder / self.cache.name)

    def tell(self, code: str = "seven.tell()", *, env=None, umask: int = -1, **process) -> Told:
        """Run both kernels, and tell what came of it.

        With other words, or a library to load, in a process that is started; else in a forked one.
        """
        if process or (env and "LD_PRELOAD" in env):
            return told_by(self.start(code, env=env, umask=umask, **process))
        program = f"from fasaco_edge.kernels import seven\n{code}"
        environment = self._environment(env)
        return told(*run_forked(("-c", program), environment, PATIENCE_S, str(self.root), umask))

    def start(
        self,
        code: str = "seven.tell()",
        *,
        name: str = "seven",
        before: str = "",
        words=(),
        env=None,
        **process,
    ):
        """Begin a process that imports the module ``name`` of kernels, and runs ``code``."""
        program = [
            *words,
            sys.executable,
            "-c",
            f"{before}\nfrom fasaco_edge.kernels import {name}\n{code}",
        ]
        return subprocess.Popen(
            program,
            cwd=self.root,
            env=self._environment(env),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **process,
        )

    def _environment(self, env: dict[str, str | None] | None) -> dict[str, str]:
        ours = {"NUMBA_DISABLE_JIT": "0", "NUMBA_CACHE_DIR": str(self.cache)}
        environment = os.environ | ours | (env or {})
        return {name: value for name, value in environment.items() if value is not None}

    def look(self, env: dict[str, str]) -> str:
        """Return what a process that runs no kernel says is missing."""
        code = "folder, _ = cache.usable_folder()\nprint(cache.missing_from(folder))"
        out, err = self.start(code, name="cache", env=env).communicate(timeout=100)
        assert err == ""
        return out.strip()

    @property
    def folder(self) -> Path:
        """The folder within the cache."""
        (folder,) = self.cache.glob("kernels-*")
        return folder


def told_by(process: subprocess.Popen[str]) -> Told:
    """Wait for the end of a process, and return what it has told."""
    out, err = process.communicate(timeout=PATIENCE_S)
    return told(process.returncode, out, err)


def told(code: int, out: str, err: str) -> Told:
    """Return what a process has told that ended so."""
    assert code == 0, err
    assert err == ""
    return Told(*json.loads(out.splitlines()[-1]))


def fill_with(cache: Path, count: int, name: str = "kernels-0") -> list[Path]:
    """Make sealed files, as if these were compiled kernels, and the list of them; return all."""
    folder = cache / name
    folder.mkdir(parents=True, mode=0o700)
    for number in range(count):
        payload = bytes(range(256)) * (number + 1)
        sealed.write_sealed(folder / f"{number}{KERNEL_SUFFIX}", payload)
    note_complete(folder)
    return kernel_files(cache)


def package_in(folder: Path) -> Path:
    """Begin another installation, of no kernels yet; return the place for them."""
    package = folder / "fasaco_edge" / "kernels"
    package.mkdir(parents=True)
    for part in (package.parent / "__init__.py", package / "__init__.py"):
        part.touch()
    shutil.copytree(Path(host.__file__).parent, package.parent / "host")
    for module in (jit, code_files, compiler, cache, release, sealed):
        shutil.copy(module.__file__, package)
    return package
