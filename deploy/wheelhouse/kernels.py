"""Compiled kernels in our wheel: a robot that is installed from it compiles nothing.

They are compiled by the very wheels of the release, in an environment of its own, for any processor
of this computer's kind. For another kind, or another Python than there is one of here, they come
from a folder that was filled there (``fasaco-edge warmup --for-release``); without one the wheel
stays as it is, and a robot compiles its kernels while it is installed.
"""

from __future__ import annotations

import base64
import hashlib
import json
import platform
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from wheelhouse.closure import IncompleteError, Target

INSIDE = "fasaco_edge/_share/kernels"
SOURCES = "fasaco_edge/kernels/"


def python_for(target: Target) -> str | None:
    """Return the Python here that kernels for ``target`` can be compiled with; None without one."""
    if target.machine != platform.machine():
        return None
    if target.python == f"{sys.version_info.major}.{sys.version_info.minor}":
        return sys.executable
    return shutil.which(f"python{target.python}")


def compile_kernels(python: str, wheels: Path, own: Path, pip: Path, scratch: Path) -> Path:
    """Compile all kernels of our wheel; return the folder of them and their manifest.

    Args:
        python: the Python to compile with.
        wheels: a folder of all wheels that ours needs.
        own: our wheel.
        pip: pip's.
        scratch: an empty folder to do it in.

    Raises:
        subprocess.CalledProcessError: that failed; it has said why.
    """
    place = scratch / "environment"
    subprocess.run([python, "-I", "-m", "venv", "--without-pip", place], check=True)
    inside = str(place / "bin/python")
    run = [inside, f"{pip}/pip", "--isolated", "--quiet", "--disable-pip-version-check"]
    folders = ("--no-index", "--find-links", str(wheels))
    subprocess.run([*run, "install", *folders, str(own)], check=True)
    kernels = scratch / "kernels"
    subprocess.run([place / "bin/fasaco-edge", "warmup", "--for-release", kernels], check=True)
    return kernels


def check_kernels(kernels: Path, wheel: Path, target: Target, versions: Mapping[str, str]) -> None:
    """Check that a robot will use them: what does not fit is compiled again there.

    Args:
        kernels: the folder of them and their manifest.
        wheel: ours, with the sources.
        target: the computer they are to be for.
        versions: of each project of the release its version.

    Raises:
        IncompleteError: they were made of or for something else, or there is no manifest.
    """
    try:
        document = json.loads((kernels / "manifest.json").read_text("utf-8"))
        made_for = {what: str(value) for what, value in document["made_for"].items()}
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise IncompleteError(
            f"{kernels} is no folder of `fasaco-edge warmup --for-release`: {error}"
        ) from error
    made_for["python"] = made_for.get("python", "").partition(" ")[0]
    wanted = {
        "machine": target.machine,
        "python": f"cpython-{target.python.replace('.', '')}",
        "sources": sources_digest(wheel),
        "numba": versions["numba"],
        "llvmlite": versions["llvmlite"],
    }
    for what, value in wanted.items():
        if (there := made_for.get(what)) != value:
            raise IncompleteError(f"the kernels in {kernels} are for {what} {there}, not {value}")


def sources_digest(wheel: Path) -> str:
    """Return the hash of a wheel's kernel sources, as ``fasaco_edge.kernels.release`` has it."""
    digest = hashlib.sha256()
    with zipfile.ZipFile(wheel) as opened:
        names = (name for name in opened.namelist() if name.startswith(SOURCES))
        for name in sorted((name for name in names if name.endswith(".py")), key=PurePosixPath):
            digest.update(opened.read(name))
    return digest.hexdigest()[:12]


def with_kernels(wheel: Path, kernels: Path, target: Target) -> Path:
    """Write the wheel anew with compiled kernels, and return it; the old one is gone.

    Args:
        wheel: ours, for any computer.
        kernels: the folder of them and their manifest.
        target: the computer they are for.
    """
    python = f"cp{target.python.replace('.', '')}"
    tag = f"{python}-none-manylinux_2_17_{target.machine}"
    name, version, *_ = wheel.name.split("-")
    made = wheel.with_name(f"{name}-{version}-{tag}.whl")
    added = {f"{INSIDE}/{file.name}": file.read_bytes() for file in sorted(kernels.iterdir())}
    with zipfile.ZipFile(wheel) as plain, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as out:
        for member in plain.infolist():
            content = plain.read(member)
            if member.filename.endswith(".dist-info/RECORD"):
                content = _recorded(content, added, f"{name}-{version}.dist-info/WHEEL", tag)
            elif member.filename.endswith(".dist-info/WHEEL"):
                content = _tagged(tag)
            out.writestr(member, content, zipfile.ZIP_DEFLATED)
        for path, content in added.items():
            # Always of the same time, as those that are built: the same wheel each time.
            out.writestr(
                zipfile.ZipInfo(path, (2020, 2, 2, 0, 0, 0)), content, zipfile.ZIP_DEFLATED
            )
    wheel.unlink()
    return made


def _tagged(tag: str) -> bytes:
    lines = ("Wheel-Version: 1.0", "Generator: fasaco-edge wheelhouse", "Root-Is-Purelib: false")
    return "\n".join((*lines, f"Tag: {tag}", "")).encode()


def _recorded(record: bytes, added: dict[str, bytes], wheel: str, tag: str) -> bytes:
    """Return RECORD with the added files, and what has become of WHEEL."""
    kept = [line for line in record.splitlines() if not line.startswith(wheel.encode() + b",")]
    new = added | {wheel: _tagged(tag)}
    return b"\n".join([*kept, *(_line(path, content) for path, content in new.items()), b""])


def _line(path: str, content: bytes) -> bytes:
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{path},sha256={digest},{len(content)}".encode()
