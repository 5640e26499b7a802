"""The manifest of a folder of compiled kernels: what is in it, file by file, as it was compiled.

A power failure leaves files that are empty, truncated or full of zeros, a worn card wrong bytes;
such machine code crashes the process, and a pickle may do anything. So the manifest has size and
SHA-256 of each file, and files are compared with it before numba reads a byte. The manifest also
lists the compiled stages of the warm-up. The comparison detects damage, but not an attack, which
could also change the manifest: ``fasaco_edge.host.files`` checks which users could have written the
folder.

One process compiles at a time, as numba's own index of a function's files goes wrong where two
write it: that process holds a lock on the folder. A file that it compiles counts once it is in the
manifest; readers wait meanwhile. A folder without a sound manifest is cleared.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from fasaco_edge.host.durable import make_folder, sync_folder, write_through
from fasaco_edge.host.files import UntrustedFileError, read_trusted, why_not_trusted
from fasaco_edge.kernels.folder import places, why_not_writable

MANIFEST, LOCK = "manifest.json", "lock"
_NEW = "manifest.new"
NEVER = "they were never compiled for this version"
# Manifests of folders that were compared with their files by this process.
_COMPARED: dict[Path, bytes] = {}


@dataclass(slots=True)
class Manifest:
    """Size and SHA-256 of each file, and the stages of which all files are there."""

    stages: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)

    def why_short_of(self, stages: Collection[str]) -> str:
        """Return which of ``stages`` is not compiled; "" if all are."""
        missing = [stage for stage in stages if stage not in self.stages]
        return f"not compiled yet: {', '.join(missing)}" if missing else ""


class UnsoundError(Exception):
    """Kernels in a folder cannot be used; the text says why."""


def read_manifest(
    folder: Path, user: int | None = None, waiting: Callable[[], None] | None = None
) -> Manifest:
    """Return the manifest of a folder after all files were compared with it, once per process.

    Args:
        folder: the folder.
        user: the user who would load the kernels; by default the user of this process.
        waiting: called before a wait for a process that compiles; None for no wait.

    Raises:
        UnsoundError: there is no manifest, a file differs, or others could have written the folder.
    """
    if why := why_not_trusted(folder, user):
        raise UnsoundError(why)
    with _locked(folder, fcntl.LOCK_SH, waiting):
        content, manifest = _parsed(folder, user)
        if _COMPARED.get(folder) != content:
            for name, seal in manifest.files.items():
                if why := _why_another(folder / name, seal, user):
                    raise UnsoundError(f"{name} {why}")
            _COMPARED[folder] = content
    return manifest


def _parsed(folder: Path, user: int | None) -> tuple[bytes, Manifest]:
    try:
        content = read_trusted(folder / MANIFEST, user)
        document = json.loads(content)
        files = {str(name): str(seal) for name, seal in document["files"].items()}
        return content, Manifest([str(stage) for stage in document["stages"]], files)
    except FileNotFoundError:
        raise UnsoundError(NEVER) from None
    except OSError as error:
        raise UnsoundError(f"{MANIFEST} cannot be read: {error.strerror}") from error
    except UntrustedFileError as why:
        raise UnsoundError(f"{MANIFEST} is not trusted: {why}") from why
    except (ValueError, TypeError, LookupError, AttributeError):
        raise UnsoundError(f"{MANIFEST} is damaged") from None


def _why_another(file: Path, seal: str, user: int | None = None) -> str:
    try:
        content = read_trusted(file, user)
    except FileNotFoundError:
        return "is gone"
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    except UntrustedFileError as why:
        return f"is not trusted: {why}"
    return "" if _seal(content) == seal else "is damaged"


def _seal(content: bytes) -> str:
    return f"{len(content)} {hashlib.sha256(content).hexdigest()}"


def why_missing(folder: Path, stages: Collection[str], user: int | None = None) -> str:
    """Return why kernels of ``stages`` would be compiled again; "" if they would not.

    Waits for nothing: while a process compiles into the folder, its files are not compared.
    """
    try:
        return read_manifest(folder, user).why_short_of(stages)
    except UnsoundError as why:
        return str(why)


def chosen_folder(stages: Collection[str] = ()) -> tuple[Path | None, str]:
    """Return this process's folder of kernels, or None; and why it is not the wanted folder.

    No folder is made.

    Args:
        stages: stages that a folder must have if it cannot be written.
    """
    reason = ""
    for folder in places():
        why = why_not_writable(folder)
        if not why or not why_missing(folder, stages):
            return folder, reason
        reason = reason or why
    return None, reason


@contextmanager
def _locked(folder: Path, operation: int, waiting: Callable[[], None] | None) -> Iterator[None]:
    """Hold a lock on a folder, see flock(2): shared to read it, exclusive to compile into it.

    A folder that is missing or read-only is not locked.

    Raises:
        UnsoundError: another process compiles into it, and this one does not wait.
    """
    try:
        descriptor = os.open(folder / LOCK, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        yield
        return
    try:
        try:
            fcntl.flock(descriptor, operation | fcntl.LOCK_NB)
        except BlockingIOError:
            if waiting is None:
                raise UnsoundError("another process is compiling them") from None
            waiting()
            fcntl.flock(descriptor, operation)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def compiling_into(folder: Path, waiting: Callable[[], None]) -> Iterator[Manifest]:
    """Yield the manifest of a folder, made if missing, while no other process writes it.

    Files that are not in the manifest, or differ from it, are removed.

    Raises:
        OSError: the folder cannot be made or written.
        UnsoundError: others could write it.
    """
    make_folder(folder, mode=0o700)
    if why := why_not_trusted(folder):
        raise UnsoundError(why)
    os.close(os.open(folder / LOCK, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600))
    with _locked(folder, fcntl.LOCK_EX, waiting):
        yield cleared(folder)


def cleared(folder: Path) -> Manifest:
    """Remove files that the manifest lacks or that differ from it; return the manifest of the rest.

    If a file of the manifest is lost, no stage counts as complete.

    Raises:
        OSError: a file cannot be removed.
    """
    try:
        _, manifest = _parsed(folder, None)
    except UnsoundError:
        manifest = Manifest()
    names = {path.name for path in folder.iterdir()} - {MANIFEST, LOCK}
    sound = {
        name: seal for name, seal in manifest.files.items() if not _why_another(folder / name, seal)
    }
    for name in names - set(sound):
        remove(folder / name)
    return manifest if sound == manifest.files else Manifest([], sound)


def record(folder: Path, manifest: Manifest, stage: str = "") -> None:
    """Write the manifest of all files now in a folder, through to the disk.

    Args:
        folder: the folder, whose lock this process holds.
        manifest: the previous manifest; it is updated.
        stage: a stage that is complete by now.

    Raises:
        OSError: writing failed; the previous manifest stays.
    """
    for file in folder.iterdir():
        if file.name in (MANIFEST, LOCK, _NEW):
            continue
        content = file.read_bytes()
        if manifest.files.get(file.name) != (seal := _seal(content)):
            _sync(file)
            manifest.files[file.name] = seal
    if stage:
        manifest.stages.append(stage)
    # The files' names are on the disk before the manifest that lists them.
    sync_folder(folder)
    document = {"stages": manifest.stages, "files": dict(sorted(manifest.files.items()))}
    write_through(folder / _NEW, json.dumps(document, indent=1).encode(), mode=0o600)
    if (folder / MANIFEST).is_dir():
        remove(folder / MANIFEST)
    (folder / _NEW).replace(folder / MANIFEST)
    sync_folder(folder)


def _sync(file: Path) -> None:
    descriptor = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def remove(path: Path) -> None:
    """Remove the file or folder of this name, if there is one.

    Raises:
        OSError: that failed.
    """
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
