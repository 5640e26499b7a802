"""Pages of libraries: given back, and there again when they are read."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

from fasaco_edge.host import libraries

# What is mapped is not the test's own: a process that has loaded the compiler, and uses it after.
GIVE_BACK = """
import re, sys
from fasaco_edge.kernels.jit import kernel
from fasaco_edge.host.libraries import unmap_unread

def resident_mb(name):
    text = open("/proc/self/status").read()
    return int(re.search(name + r":\\s+(\\d+)", text)[1]) * 1.024e-3

def twice(number):
    return number + number

assert kernel(twice)(3) == 6
before = resident_mb("RssFile"), resident_mb("RssAnon")
unmap_unread()
after = resident_mb("RssFile"), resident_mb("RssAnon")
print(*before, *after)
# Nothing that the loader or the program wrote is lost: compile, call, and load some more.
assert kernel(lambda number: number * 2.5)(4) == 10.0
import decimal, sqlite3, numpy
assert numpy.linalg.inv(numpy.diag([2.0, 4.0])).tolist() == [[0.5, 0.0], [0.0, 0.25]]
"""


def test_a_process_gives_back_what_it_read_of_libraries_and_goes_on():
    ended = subprocess.run(
        [sys.executable, "-c", GIVE_BACK], capture_output=True, text=True, check=True
    )
    file_before, own_before, file_after, own_after = map(float, ended.stdout.split())
    print(f"of files {file_before:.1f} -> {file_after:.1f} MB, its own {own_after:.1f} MB")
    assert file_after < 0.4 * file_before
    assert abs(own_after - own_before) < 1.0


PAGE = 4096
READ, RUN, WRITE = 4, 5, 6
LOAD, DYNAMIC = 1, 2


def library(
    *segments: tuple[int, int, int, int], name: bytes = b"/lib/some.so", base: int = 0
) -> libraries._Library:
    """Return a library of segments: kind, flags, address, bytes in the file."""
    table = (libraries._Segment * len(segments))()
    for entry, (kind, flags, address, size) in zip(table, segments, strict=True):
        entry.kind, entry.flags, entry.address, entry.file_size = kind, flags, address, size
    return libraries._Library(base, name, table, len(segments))


@pytest.fixture(autouse=True)
def pages_of_4096(monkeypatch):
    monkeypatch.setattr("fasaco_edge.host.libraries.mmap.PAGESIZE", PAGE)


def test_whole_pages_of_what_is_never_written_are_let_go():
    """Its first and its last page may belong to others, too."""
    found = library(
        (LOAD, READ, 0, 3 * PAGE),
        (LOAD, RUN, 4 * PAGE + 100, 2 * PAGE),
        (LOAD, READ, 8 * PAGE + 100, PAGE),
        (LOAD, WRITE, 20 * PAGE, 9 * PAGE),
        base=100 * PAGE,
    )
    pages = [(start // PAGE, end // PAGE) for start, end in libraries._unwritten(found)]
    assert pages == [(100, 103), (105, 106)]


@pytest.mark.parametrize("name", [b"", b"linux-vdso.so.1"])
def test_what_is_no_file_is_kept(name):
    assert not list(libraries._unwritten(library((LOAD, RUN, 0, 3 * PAGE), name=name)))


@pytest.mark.parametrize(
    ("entries", "is_kept"),
    [
        (((1, 7), (22, 0), (0, 0)), True),
        (((30, 4), (0, 0)), True),
        (((30, 8), (22 + 1, 0), (0, 0), (22, 0)), False),
    ],
)
def test_a_library_whose_text_is_relocated_is_kept(entries, is_kept):
    table = (libraries._Entry * len(entries))(*entries)
    text, dynamic = (LOAD, RUN, 0, 3 * PAGE), (DYNAMIC, WRITE, ctypes.addressof(table), 0)
    assert (not list(libraries._unwritten(library(text, dynamic)))) == is_kept
