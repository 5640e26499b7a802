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
from fasaco_edge.kernels import folder, jit, manifest, scratch
from tests.support.forked import run_forked

KERNELS = """
import contextlib
import json
import logging
import os

# Before anything can be logged.
logging.basicConfig(handlers=[handler := logging.Handler()])
said = []
handler.emit = lambda record: said.append(record.getMessage())

from fasaco_edge.kernels import jit, manifest

held = contextlib.ExitStack()
place = manifest.chosen_folder()[0]
if "COMPILES" in os.environ:
    noted = held.enter_context(manifest.compiling_into(place, lambda: print("waits", flush=True)))
    jit.compile_into(place, lambda compiled: None)

@jit.kernel
def seven(x):
    return 7 * x

@jit.kernel
def eight(x):
    return seven(x) + x

more = []

def tell(x=1):
    assert eight(x) == 8 * x
    if "COMPILES" in os.environ:
        if not noted.stages:
            manifest.record(place, noted, "all")
        held.close()
    stats = [seven.stats, eight.stats, *more]
    loaded, compiled = (
        sum(sum(getattr(stat, kind).values()) for stat in stats)
        for kind in ("cache_hits", "cache_misses")
    )
    print(json.dumps([loaded, compiled, said, place and str(place)]))
"""


@dataclass(frozen=True)
class Told:
    """What a process did: how many kernels it loaded and compiled, and where they are."""

    loaded: int
    compiled: int
    warnings: list[str]
    folder: str | None

    @property
    def work(self) -> tuple[int, int, list[str]]:
        """All but the folder."""
        return self.loaded, self.compiled, self.warnings


PATIENCE_S = 300.0
COMPILES = {"COMPILES": "1"}
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

    def compile(self, *, env=None, umask: int = -1, **process) -> Told:
        """Run both kernels in a process that compiles into the folder."""
        return self.tell(env=COMPILES | (env or {}), umask=umask, **process)

    def tell(self, code: str = "seven.tell()", *, env=None, umask: int = -1, **process) -> Told:
        """Run both kernels, and tell what came of it.

        With other words, in a process that is started; else in a forked one.
        """
        if process:
            return told_by(self.start(code, env=env, umask=umask, **process))
        program = f"from fasaco_edge.kernels import seven\n{code}"
        environment = self._environment(env)
        return told(*run_forked(("-c", program), environment, PATIENCE_S, str(self.root), umask))

    def start(
        self, code: str = "seven.tell()", *, before: str = "", words=(), env=None, **process
    ) -> subprocess.Popen[str]:
        """Begin a process that imports the kernels, and runs ``code``."""
        program = f"{before}\nfrom fasaco_edge.kernels import seven\n{code}"
        return subprocess.Popen(
            [*words, sys.executable, "-c", program],
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


def fill_with(cache: Path, count: int, name: str = "kernels-0", stages=("all",)) -> Path:
    """Make files, as if these were compiled kernels, and their manifest; return the folder."""
    place = cache / name
    with manifest.compiling_into(place, lambda: None) as noted:
        for number in range(count):
            (place / f"{number}.nbc").write_bytes(bytes(range(256)) * (number + 1))
            (place / f"{number}.nbc").chmod(0o600)
        noted.stages += stages
        manifest.record(place, noted)
    return place


def package_in(root: Path) -> Path:
    """Begin another installation, of no kernels yet; return the place for them."""
    package = root / "fasaco_edge" / "kernels"
    package.mkdir(parents=True)
    for part in (package.parent / "__init__.py", package / "__init__.py"):
        part.touch()
    shutil.copytree(Path(host.__file__).parent, package.parent / "host")
    for module in (jit, folder, manifest, scratch):
        shutil.copy(module.__file__, package)
    return package
