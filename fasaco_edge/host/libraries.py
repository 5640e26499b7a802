"""Shared libraries in memory: the pages of their files that a process does not need at present.

Loading a library maps pages that are never read again: relocations, and code that runs once. The
compiler's pages alone are 70 MB of a daemon with kernels. They belong to the system's page cache,
which first reclaims pages that no process has mapped. A page that is read again is mapped again, in
microseconds while it is in that cache.
"""

from __future__ import annotations

import ctypes
import mmap
import os
from collections.abc import Iterator
from itertools import count, takewhile
from pathlib import Path

# elf(5), of 64 bits.
_MAGIC = b"\x7fELF\x02"
_LOAD, _DYNAMIC = 1, 2
_WRITABLE = 2
_END, _TEXT_RELOCATED, _FLAGS, _FLAG_TEXT_RELOCATED = 0, 22, 30, 4
# dlinfo(3): where a library is.
_LINK_MAP = 2


class _Header(ctypes.Structure):
    """Elf64_Ehdr."""

    _fields_ = (
        ("identity", ctypes.c_ubyte * 16),
        ("kind", ctypes.c_uint16),
        ("machine", ctypes.c_uint16),
        ("version", ctypes.c_uint32),
        ("entry", ctypes.c_uint64),
        ("segments_at", ctypes.c_uint64),
        ("sections_at", ctypes.c_uint64),
        ("flags", ctypes.c_uint32),
        ("header_size", ctypes.c_uint16),
        ("segment_size", ctypes.c_uint16),
        ("segment_count", ctypes.c_uint16),
    )


class _Segment(ctypes.Structure):
    """Elf64_Phdr."""

    _fields_ = (
        ("kind", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("offset", ctypes.c_uint64),
        ("address", ctypes.c_uint64),
        ("physical", ctypes.c_uint64),
        ("file_size", ctypes.c_uint64),
        ("size", ctypes.c_uint64),
        ("alignment", ctypes.c_uint64),
    )


class _Entry(ctypes.Structure):
    """Elf64_Dyn."""

    _fields_ = (("tag", ctypes.c_int64), ("value", ctypes.c_uint64))


def unmap_unread() -> None:
    """Release all pages of libraries that are never written to, if the C library can.

    Such pages equal their file, so they can be mapped again. Pages of writable segments are kept,
    also of those that only the loader writes, before it makes them read-only.

    The loader could list its libraries, too, but holds its lock meanwhile (dl_iterate_phdr): a
    thread that imports at that time waits for that lock while it holds the interpreter's, for ever.
    """
    c_library = ctypes.CDLL(None)
    madvise = getattr(c_library, "madvise", None)
    if madvise is None or not hasattr(c_library, "dlinfo"):
        return
    madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    for name, start in _mapped_programs():
        if _keep_loaded(c_library, name) == start:
            for first, last in _unwritten(start):
                madvise(first, last - first, mmap.MADV_DONTNEED)


def _mapped_programs() -> Iterator[tuple[str, int]]:
    """Yield name and first address of each mapped file with executable pages."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return
    lines = [line.split(maxsplit=5) for line in maps.splitlines()]
    files = [words for words in lines if len(words) == 6 and words[5].startswith("/")]
    programs = {words[5] for words in files if "x" in words[1]}
    for addresses, _, offset, _, _, name in files:
        if name in programs and int(offset, 16) == 0:
            yield name, int(addresses.partition("-")[0], 16)


def _keep_loaded(c_library: ctypes.CDLL, name: str) -> int | None:
    """Keep a library loaded, and return its address; None if the file is no library."""
    try:
        handle = ctypes.CDLL(name, mode=os.RTLD_NOLOAD)._handle
    except (OSError, ValueError):
        return None  # the program itself, or a file that was replaced
    link_map = ctypes.POINTER(ctypes.c_size_t)()
    if c_library.dlinfo(ctypes.c_void_p(handle), _LINK_MAP, ctypes.byref(link_map)):
        return None
    return int(link_map[0])


def _unwritten(start: int) -> Iterator[tuple[int, int]]:
    """Yield first and last address of whole pages that were never, and cannot be, written to.

    Args:
        start: where a library is, its header first.
    """
    header = _Header.from_address(start)
    if not bytes(header.identity).startswith(_MAGIC):
        return
    segments = (_Segment * header.segment_count).from_address(start + header.segments_at)
    if any(_relocates_text(start, segment) for segment in segments):
        return
    page = mmap.PAGESIZE
    for segment in segments:
        if segment.kind == _LOAD and not segment.flags & _WRITABLE:
            begin = start + segment.address
            # Its first and last page may be the end and the beginning of other segments.
            first, last = -(-begin // page) * page, (begin + segment.file_size) // page * page
            if first < last:
                yield first, last


def _relocates_text(start: int, segment: _Segment) -> bool:
    """Return whether the loader writes to pages that it makes read-only afterwards."""
    if segment.kind != _DYNAMIC:
        return False
    table = ctypes.cast(start + segment.address, ctypes.POINTER(_Entry))
    entries = takewhile(lambda entry: entry.tag != _END, map(table.__getitem__, count()))
    return any(
        entry.tag == _TEXT_RELOCATED or (entry.tag == _FLAGS and entry.value & _FLAG_TEXT_RELOCATED)
        for entry in entries
    )
