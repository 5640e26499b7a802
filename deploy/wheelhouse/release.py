"""A release folder: wheels of fasaco_edge and all it needs, and the files that install them.

``wheels`` holds beside the wheels two lists for pip, each with hashes, with recording and without,
and RELEASE, what ``install.sh`` has to know before it begins.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from wheelhouse.closure import Closure, Target, closure_of, installed_mb
from wheelhouse.viewer import without_viewer

DEPLOY = Path(__file__).resolve().parents[1]
SOURCE = DEPLOY.parent
# Wheels for the C library of Debian 10 and later: what they need is a part of every newer one.
MANYLINUX = ("2_28", "2_27", "2_24", "2_17")
LOCK, RECORD_LOCK = "requirements.txt", "requirements-record.txt"


def make_release(target: Target, out: Path, *, recording: bool) -> Path:
    """Make a release folder within ``out`` and return it.

    Args:
        target: the computer it is for.
        out: where to.
        recording: whether Rerun comes along.

    Raises:
        IncompleteError: a wheel that another one needs is not there.
        subprocess.CalledProcessError: pip could not get something; it has said what.
    """
    with tempfile.TemporaryDirectory() as scratch:
        wheels = Path(scratch) / "wheels"
        _pip("wheel", "--no-deps", "--wheel-dir", wheels, SOURCE)
        own = next(wheels.glob("fasaco_edge-*.whl"))
        wanted = f"{own}[record]" if recording else str(own)
        _pip("download", "--dest", wheels, *_platform(target), wanted)
        for rerun in wheels.glob("rerun_sdk-*.whl"):
            without_viewer(rerun)
        _pip("download", "--no-deps", "--dest", scratch, "pip")
        pip = next(Path(scratch).glob("pip-*.whl"))
        release = out / f"fasaco-edge-{own.name.split('-')[1]}-{target.name}"
        fill_release(release, wheels, pip, target, recording=recording)
    _try_out(release, target)
    return release


def fill_release(
    release: Path, wheels: Path, pip: Path, target: Target, *, recording: bool
) -> None:
    """Put the wheels and the files of ``deploy`` into a release folder, with what describes them.

    Args:
        release: the folder; one that is there is replaced.
        wheels: a folder of wheels.
        pip: pip's wheel. It comes along to do its work from there: the robot's own may be old, or
            not there, and what is installed needs none.
        target: the computer they are for.
        recording: whether Rerun comes along.

    Raises:
        IncompleteError: a wheel that another one needs is not there.
    """
    without = shutil.ignore_patterns("wheelhouse", "__pycache__", "Containerfile")
    base = closure_of(wheels, target, extras=())
    whole = closure_of(wheels, target, extras=("record",)) if recording else base
    shutil.rmtree(release, ignore_errors=True)
    (release / "wheels").mkdir(parents=True)
    for file in whole.files.values():
        shutil.copy2(file, release / "wheels")
    shutil.copy2(pip, release / "wheels")
    shutil.copytree(DEPLOY, release, ignore=without, dirs_exist_ok=True)
    _write_lock(release / "wheels" / LOCK, base, target)
    if recording:
        _write_lock(release / "wheels" / RECORD_LOCK, whole, target)
    (release / "wheels" / "RELEASE").write_text(
        f"VERSION={whole.version}\nARCH={target.machine}\nPYTHON={target.python}\n"
        f"INSTALLED_MB={installed_mb(base.files.values())}\n"
        f"INSTALLED_MB_RECORDING={installed_mb(whole.files.values()) if recording else 0}\n",
        encoding="utf-8",
    )


def _write_lock(file: Path, closure: Closure, target: Target) -> None:
    lines = [f"# For {target.machine}, Python {target.python}; pip checks each hash."]
    for name, digest in sorted(closure.digests().items()):
        lines.append(f"{name}=={closure.versions[name]} --hash=sha256:{digest}")
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _try_out(release: Path, target: Target) -> None:
    """Let pip resolve each list for the target from this folder alone, and report."""
    wheels = release / "wheels"
    for lock in sorted(wheels.glob("requirements*.txt")):
        with tempfile.TemporaryDirectory() as nowhere:
            folders = ("--no-index", "--find-links", wheels, "--dest", nowhere)
            _pip("download", "--require-hashes", *folders, *_platform(target), "-r", lock)
        files = [line for line in lock.read_text("utf-8").splitlines() if "--hash" in line]
        print(f"{lock.name}: complete, {len(files)} wheels with their hashes")
    for file in sorted(wheels.glob("*.whl"), key=lambda file: -file.stat().st_size):
        print(f"  {file.stat().st_size / 1e6:6.1f} MB  {file.name}")


def _platform(target: Target) -> list[str]:
    tags = [f"manylinux_{libc}_{target.machine}" for libc in MANYLINUX]
    platforms = [f"--platform={tag}" for tag in (*tags, f"manylinux2014_{target.machine}")]
    version = f"--python-version={target.python}"
    return ["--only-binary=:all:", "--implementation=cp", version, *platforms]


def _pip(command: str, *words: str | Path) -> None:
    quiet = ["--quiet", "--disable-pip-version-check"]
    subprocess.run(
        [sys.executable, "-I", "-m", "pip", command, *quiet, *map(str, words)], check=True
    )
