"""Files and folders that no other user of this computer can have written.

Own files belong to this process's user or to root. Trusted files, whose content is run as code, are
also in folders to which only root and one user may write, including all parent folders: a user who
can write to a folder can replace its files. Two cases are safe: in a sticky folder (``/tmp``) only
the owner of a file can replace it; and a link is as safe as its owner and its folder (systemd's
``/var/cache/NAME`` of a DynamicUser= is a link that belongs to root).
"""

from __future__ import annotations

import errno
import os
import pwd
import stat
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import BinaryIO


def open_own(path: str | Path, flags: int, mode: int = 0o644) -> int:
    """Open a file for writing, created if it is missing; return its descriptor.

    A link is not followed, and a plain file of another user is refused: in a folder that others may
    write to, either may be an attack.

    Raises:
        OSError: it failed, or the file belongs to another user.
    """
    flags |= os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    # An existing file is truncated only after its owner has been checked.
    descriptor = os.open(path, flags & ~os.O_TRUNC, mode)
    try:
        status = os.fstat(descriptor)
        if stat.S_ISREG(status.st_mode):
            _check_owner(path, status)
            if flags & os.O_TRUNC:
                os.ftruncate(descriptor, 0)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


class FileTooLongError(OSError):
    """A file is longer than its reader allows; the text gives both sizes."""

    def __init__(self, path: str | Path, size: int, most: int) -> None:
        super().__init__(errno.EFBIG, f"{size} bytes, at most {most} are read", str(path))


def read_own(path: str | Path, most: int) -> bytes:
    """Return the whole content of a plain file, not a link, of this process's user or of root.

    Raises:
        FileTooLongError: it has more than ``most`` bytes.
        OSError: it failed, or it belongs to another user.
    """
    with _open_plain(path, partial(_check_owner, path)) as file:
        content = file.read(most + 1)
        if len(content) > most:
            size = os.fstat(file.fileno()).st_size
            raise FileTooLongError(path, max(size, len(content)), most)
    return content


def _open_plain(path: str | Path, check: Callable[[os.stat_result], None]) -> BinaryIO:
    """Open a plain file, not a link, for reading; ``check`` inspects the opened file."""
    # Without O_NONBLOCK, opening a pipe or a device may block.
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        status = os.fstat(descriptor)
        check(status)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "no plain file", str(path))
        return open(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def check_plain(path: str | Path) -> None:
    """Check that a file named by a user is a plain file, or a link to one.

    Opening a pipe waits until it has a writer, and reading a device may never end.

    Raises:
        OSError: it is neither, or is missing.
    """
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a device or a socket"
        raise OSError(errno.EINVAL, f"{kind}, no plain file", str(path))


def make_own_folder(folder: Path) -> None:
    """Make a folder, or accept an existing one, or a link to one, of this process's user or root.

    Raises:
        OSError: it failed, or it belongs to another user.
    """
    folder.mkdir(exist_ok=True)
    _check_owner(folder, folder.lstat())


def _check_owner(path: str | Path, status: os.stat_result) -> None:
    if status.st_uid not in (os.geteuid(), 0):
        raise PermissionError(errno.EPERM, "another user has put it there", str(path))


_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
# Largest number of links followed, as by Linux, see path_resolution(7).
_MOST_LINKS = 40


class UntrustedFileError(Exception):
    """Another user could have written a file; the text names the file and the user."""


def why_not_trusted(folder: Path, user: int | None = None) -> str:
    """Return why others could change the content of ``folder``; "" if they could not.

    Args:
        folder: an absolute path. If it is missing, its existing parents are checked: "" if a folder
            made now would be trusted.
        user: the user who may own the folder, besides root; by default this process's user.
    """
    try:
        _walk(folder, _trusted(user))
    except UntrustedFileError as why:
        return str(why)
    except OSError as error:
        return f"{error.filename}: {error.strerror}"
    return ""


def read_trusted(file: Path, user: int | None = None) -> bytes:
    """Return the content of a file in a trusted folder.

    Raises:
        UntrustedFileError: others could have written it, or it is not a plain file.
        OSError: it is not there, or cannot be read.
    """

    def check(status: os.stat_result) -> None:
        if not stat.S_ISREG(status.st_mode):
            raise UntrustedFileError(f"{file} is no plain file")
        _look_at(file, status, _trusted(user))

    with _open_plain(file, check) as opened:
        return opened.read()


def _trusted(user: int | None) -> frozenset[int]:
    return frozenset((0, os.geteuid() if user is None else user))


def _walk(folder: Path, trusted: frozenset[int]) -> None:
    """Check each folder and link from the root to ``folder``."""
    place, links = Path("/"), 0
    ahead = list(reversed(folder.parts[1:]))
    status = os.lstat(place)
    while True:
        # In a sticky folder others cannot replace an entry; the next step checks its owner.
        sticky = ahead and status.st_mode & stat.S_ISVTX
        _look_at(place, status, trusted, may_write=bool(sticky))
        if not ahead:
            break
        part = ahead.pop()
        if part == "..":  # parts of a link's target; ``place`` has no links in it
            place, status = place.parent, os.lstat(place.parent)
            continue
        try:
            status = os.lstat(place / part)
        except FileNotFoundError:
            return
        if stat.S_ISLNK(status.st_mode):
            links += 1
            if status.st_uid not in trusted:
                raise UntrustedFileError(f"{place / part} is a link of {_user(status.st_uid)}")
            if links > _MOST_LINKS:
                raise UntrustedFileError(f"{folder}: too many links")
            target = Path(os.readlink(place / part))
            ahead += reversed(target.parts[1:] if target.is_absolute() else target.parts)
            place = Path("/") if target.is_absolute() else place
            status = os.lstat(place)
            continue
        place /= part
        if not stat.S_ISDIR(status.st_mode):
            raise UntrustedFileError(f"{place} is no folder")


def _look_at(
    place: Path, status: os.stat_result, trusted: frozenset[int], *, may_write: bool = False
) -> None:
    if status.st_uid not in trusted:
        raise UntrustedFileError(f"{place} belongs to {_user(status.st_uid)}")
    # The group's bits include the entries of an access control list.
    if status.st_mode & _OTHERS_WRITE and not may_write:
        who = "all users" if status.st_mode & stat.S_IWOTH else "its group"
        raise UntrustedFileError(f"{place} may be written by {who}")


def _user(uid: int) -> str:
    try:
        return f"user {pwd.getpwuid(uid).pw_name}"
    except KeyError:
        return f"user {uid}"
