"""Pages of libraries: given back, and there again when they are read."""

from __future__ import annotations

import ctypes
import mmap
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

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


def test_a_process_releases_library_pages_and_continues():
    ended = subprocess.run(
        [sys.executable, "-c", GIVE_BACK], capture_output=True, text=True, check=True
    )
    file_before, own_before, file_after, own_after = map(float, ended.stdout.split())
    print(f"of files {file_before:.1f} -> {file_after:.1f} MB, its own {own_after:.1f} MB")
    assert file_after < 0.4 * file_before
    assert abs(own_after - own_before) < 1.0


# What an import does holding the interpreter's lock, again and again beside the giving back: each
# waited for the other for ever, in four tries of five.
LOAD_BESIDE = """
import faulthandler, shutil, sys, threading, _ctypes
from fasaco_edge.host.libraries import unmap_unread

faulthandler.dump_traceback_later(120, exit=True)
sys.setswitchinterval(1e-6)
names = [f"{sys.argv[1]}/some{number}.so" for number in range(200)]
for name in names:
    shutil.copy(_ctypes.__file__, name)

def load():
    for name in names:
        _ctypes.dlopen(name, 2)

loading = threading.Thread(target=load)
loading.start()
while loading.is_alive():
    unmap_unread()
"""


def test_libraries_can_be_loaded_meanwhile(tmp_path):
    command = [sys.executable, "-c", LOAD_BESIDE, str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


PAGE = 4096
READ, RUN, WRITE = 4, 5, 6
LOAD, DYNAMIC = 1, 2


@contextmanager
def library(*segments: tuple[int, int, int, int], magic: bytes = b"\x7fELF\x02") -> Iterator[int]:
    """Yield where a library begins, of segments: kind, flags, address, bytes in the file."""
    with mmap.mmap(-1, PAGE) as image:
        start = ctypes.addressof(anchor := ctypes.c_char.from_buffer(image))
        header = libraries._Header.from_address(start)
        header.identity[: len(magic)] = tuple(magic)
        header.segments_at, header.segment_count = 64, len(segments)
        for at, (kind, flags, address, size) in enumerate(segments):
            entry = libraries._Segment.from_address(start + 64 + at * 56)
            entry.kind, entry.flags, entry.address, entry.file_size = kind, flags, address, size
        yield start
        del anchor


@pytest.fixture(autouse=True)
def pages_of_4096(monkeypatch):
    monkeypatch.setattr("fasaco_edge.host.libraries.mmap.PAGESIZE", PAGE)


def test_whole_pages_of_what_is_never_written_are_let_go():
    """Its first and its last page may belong to others, too."""
    with library(
        (LOAD, READ, 0, 3 * PAGE),
        (LOAD, RUN, 4 * PAGE + 100, 2 * PAGE),
        (LOAD, READ, 8 * PAGE + 100, PAGE),
        (LOAD, WRITE, 20 * PAGE, 9 * PAGE),
    ) as start:
        found = list(libraries._unwritten(start))
        pages = [((first - start) // PAGE, (last - start) // PAGE) for first, last in found]
    assert pages == [(0, 3), (5, 6)]


@pytest.mark.parametrize("magic", [b"\0", b"\x7fELF\x01"])
def test_what_is_no_library_of_64_bits_is_kept(magic):
    with library((LOAD, RUN, 0, 3 * PAGE), magic=magic) as start:
        assert not list(libraries._unwritten(start))


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
    with library((LOAD, RUN, 0, 3 * PAGE), (DYNAMIC, WRITE, 0, 0)) as start:
        segment = libraries._Segment.from_address(start + 64 + 56)
        segment.address = (ctypes.addressof(table) - start) % (1 << 64)
        assert (not list(libraries._unwritten(start))) == is_kept
