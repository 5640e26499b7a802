"""Compiled kernels shipped with an installation: a folder of code files, and their manifest.

A release (``make wheelhouse``) compiles them for any processor of its kind, so that no robot has
to: a first start compiles for a minute or more, and needs 500 MB for it. The manifest states their
sources and target, and has the SHA-256 of each file. If anything differs, a source, the compiler,
Python or a single byte, none of them is used: kernels are then compiled into the user's own folder,
as in an installation from sources, which has none.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import json
import logging
import platform
import sys
from importlib import metadata
from pathlib import Path

from fasaco_edge.host.files import UntrustedFileError, read_trusted, why_not_trusted

LOG = logging.getLogger(__name__)

KERNELS = Path(__file__).parent
KERNEL_SOURCES = sorted(KERNELS.rglob("*.py"))
KERNEL_SUFFIX = ".kernel"
COMPILERS = ("numba", "llvmlite")
FOLDER = KERNELS.parent / "_share" / "kernels"
MANIFEST = "manifest.json"
# Baseline of each kind of processor: name and features, as in numba.
ANY_PROCESSOR = ("generic", "")
# The environment of a process that compiles for all of them. The order of sets is the same each
# time, which some names in the code follow.
FOR_ANY_PROCESSOR = {
    **dict(zip(("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"), ANY_PROCESSOR, strict=True)),
    "PYTHONHASHSEED": "0",
}


def kernel_module(source: Path) -> str:
    """Return the name of a kernel source below ``fasaco_edge.kernels``, as ``ants.colony``."""
    return ".".join(source.relative_to(KERNELS).with_suffix("").parts)


def sources_digest() -> str:
    """Return a hash of every kernel source file, 12 hex digits: what the kernels compute."""
    digest = hashlib.sha256()
    for source in KERNEL_SOURCES:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def made_for() -> dict[str, str]:
    """Return the dependencies of compiled code: it can be used if all are equal.

    The patch level of Python makes no difference, nor does the processor, within its kind.
    """
    return {
        "sources": sources_digest(),
        "machine": platform.machine(),
        "python": f"{sys.implementation.cache_tag} {importlib.util.MAGIC_NUMBER.hex()}",
        **{name: metadata.version(name) for name in COMPILERS},
    }


def write_manifest(folder: Path) -> int:
    """Write the manifest of the code files in ``folder``; return how many there are.

    Raises:
        OSError: that failed.
    """
    files = {file.name: _digest(file.read_bytes()) for file in folder.glob(f"*{KERNEL_SUFFIX}")}
    document = {"made_for": made_for(), "files": dict(sorted(files.items()))}
    (folder / MANIFEST).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return len(files)


def has_kernels() -> bool:
    """Return whether this installation brings kernels along, usable or not."""
    return FOLDER.is_dir()


@functools.cache
def why_unusable(user: int | None = None) -> str:
    """Return why the kernels of this installation are not used; "" if they are.

    Checked once a process, byte by byte; faults are logged.

    Args:
        user: the user who would load them; by default this process's.
    """
    if not has_kernels():
        return "this installation brings no compiled kernels along"
    if why := _why_unusable(user):
        LOG.warning("compiled kernels of this installation are not used: %s", why)
    return why


def _why_unusable(user: int | None) -> str:
    if why := why_not_trusted(FOLDER, user):
        return why
    file = FOLDER / MANIFEST
    try:
        document = json.loads(read_trusted(file, user))
        for what, here in made_for().items():
            if (needed := document["made_for"][what]) != here:
                return f"they are for {what} {needed}, here is {here}"
        for name, digest in document["files"].items():
            file = FOLDER / name
            if _digest(read_trusted(file, user)) != digest:
                raise ValueError(name)
    except (UntrustedFileError, OSError) as error:
        return f"{file}: {error.strerror}" if isinstance(error, OSError) else str(error)
    except (ValueError, TypeError, KeyError, AttributeError):
        return f"{file} is damaged"
    return ""


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
