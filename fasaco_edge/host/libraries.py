"""Shared libraries in memory: the pages of their files that a process does not need at present.

Loading a library maps pages of it that nothing reads again: what is relocated, what runs once. The
compiler's alone are 70 MB of a daemon with kernels. They belong to the system's cache of files,
which takes back first what no process has mapped; one that is read again is mapped again, in
microseconds while it is in that cache.
"""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Iterator
from itertools import count, takewhile

# elf(5), of 64 bits.
_LOAD, _DYNAMIC = 1, 2
_WRITABLE = 2
_END, _TEXT_RELOCATED, _FLAGS, _FLAG_TEXT_RELOCATED = 0, 22, 30, 4


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


class _Library(ctypes.Structure):
    """The beginning of dl_phdr_info: all libraries for C know these."""

    _fields_ = (
        ("base", ctypes.c_uint64),
        ("name", ctypes.c_char_p),
        ("segments", ctypes.POINTER(_Segment)),
        ("count", ctypes.c_uint16),
    )


_Visitor = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(_Library), ctypes.c_size_t, ctypes.c_void_p
)


def unmap_unread() -> None:
    """Let go of all pages of libraries that are never written to, where the C library can.

    Such pages are as in their file, so they can be mapped anew; those of segments that may be
    written, as by the loader alone before it makes them read-only, are kept.
    """
    # Each call holds the loader's lock. By PyDLL it holds the interpreter's, too: without that it
    # would wait for a thread that has it, and loads a library.
    c_library = ctypes.PyDLL(None)
    visit_all = getattr(c_library, "dl_iterate_phdr", None)
    madvise = getattr(c_library, "madvise", None)
    if visit_all is None or madvise is None:
        return
    madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)

    def visit(library: ctypes._Pointer[_Library], _size: int, _data: int) -> int:
        for start, end in _unwritten(library.contents):
            madvise(start, end - start, mmap.MADV_DONTNEED)
        return 0

    visit_all(_Visitor(visit), None)


def _unwritten(library: _Library) -> Iterator[tuple[int, int]]:
    """Yield first and last address of whole pages that nothing has written to, nor may."""
    if not (library.name or b"").startswith(b"/"):
        return  # the program itself, or what the system brings along, which is no file
    segments = library.segments[: library.count]
    if any(_relocates_text(library, segment) for segment in segments):
        return
    page = mmap.PAGESIZE
    for segment in segments:
        if segment.kind == _LOAD and not segment.flags & _WRITABLE:
            start = library.base + segment.address
            # Its first and last page may be the end and the beginning of other segments.
            first, last = -(-start // page) * page, (start + segment.file_size) // page * page
            if first < last:
                yield first, last


def _relocates_text(library: _Library, segment: _Segment) -> bool:
    """Tell whether this says that the loader writes into what is read-only afterwards."""
    if segment.kind != _DYNAMIC:
        return False
    table = ctypes.cast(library.base + segment.address, ctypes.POINTER(_Entry))
    entries = takewhile(lambda entry: entry.tag != _END, map(table.__getitem__, count()))
    return any(
        entry.tag == _TEXT_RELOCATED or (entry.tag == _FLAGS and entry.value & _FLAG_TEXT_RELOCATED)
        for entry in entries
    )
