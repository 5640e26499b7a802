"""The file calls of real processes: counted, written down, or failed on purpose.

What sees them is ``file_calls.c``, which is compiled here and preloaded into the process; it has
the other half of what is laid out below. Only calls on what lies under given folders count.
"""

from __future__ import annotations

import atexit
import enum
import errno
import functools
import platform
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

SOURCE = Path(__file__).with_name("file_calls.c")
COMPILE = ("gcc", "-O1", "-Wall", "-Werror", "-shared", "-fPIC")


class Kind(enum.IntEnum):
    """What is called for; in the order of the C source."""

    OPEN = 0
    READ = 1
    WRITE = 2
    SYNC = 3
    RENAME = 4
    MAP = 5
    UNLINK = 6
    FOLDER = 7
    TRUNCATE = 8
    LOOK = 9
    LINK = 10
    ANY = 11
    """Counts them all."""


SHORT = -1
ERRORS = {name: getattr(errno, name) for name in ("EIO", "ENOSPC", "EROFS", "EACCES", "EMFILE")}
ERRORS |= {"EINTR": errno.EINTR, "short": SHORT}

MADE, EMPTIED, EVERYTHING = 1, 2, 4

_COUNTS = struct.Struct(f"<{len(Kind)}QQqqqq")
_SHARED_BYTES = _COUNTS.size + 4096
_ENTRY = struct.Struct("<IIiIQqqIIQ")


@dataclass(frozen=True, slots=True)
class Call:
    """A call that has changed something.

    Attributes:
        kind: what was called for.
        process: its id.
        file: number of the file; 0 where only names are concerned.
        offset: where in the file; for TRUNCATE its new size.
        flags: MADE and EMPTIED with OPEN, EVERYTHING where all there is was synchronised.
        at_s: when it was done [s, monotonic].
        path: what it was called on.
        second: the new name, or what a link points to.
        data: what was written.
    """

    kind: Kind
    process: int
    file: int
    offset: int
    flags: int
    at_s: float
    path: str
    second: str
    data: bytes

    def __str__(self) -> str:
        size = f" {len(self.data)} bytes at {self.offset}" if self.kind is Kind.WRITE else ""
        second = f" -> {self.second}" if self.second else ""
        return f"{self.kind.name.lower()} {self.path}{second}{size}"


@dataclass(frozen=True, slots=True)
class Failure:
    """The call that is to fail: number ``at`` of a kind, and with ``for_good`` all after it."""

    kind: Kind
    at: int
    error: str
    for_good: bool = False

    def __str__(self) -> str:
        return f"{self.kind.name.lower()}:{self.at}:{self.error}" + ("+" if self.for_good else "")

    @classmethod
    def of_text(cls, text: str) -> Failure:
        """Read what ``str`` makes of one.

        Raises:
            ValueError: it is none.
        """
        kind, at, error = text.removesuffix("+").split(":")
        if error not in ERRORS:
            raise ValueError(f"no such error: {error}")
        return cls(Kind[kind.upper()], int(at), error, text.endswith("+"))


class Watch:
    """What is preloaded into a process and all it starts; give it ``environment``.

    Args:
        under: folders; what lies elsewhere is left alone.
        failure: the call that fails.
        is_logged: write down what changes something.
    """

    def __init__(
        self, under: Sequence[Path], failure: Failure | None = None, *, is_logged: bool = False
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="file-calls-")
        self._shared, self._log = Path(self._folder.name, "shared"), Path(self._folder.name, "log")
        words = (0, 0, 0, 0)
        if failure is not None:
            words = (failure.kind, failure.at, ERRORS[failure.error], failure.for_good)
        counts = _COUNTS.pack(*[0] * (len(Kind) + 1), *words)
        self._shared.write_bytes(counts.ljust(_SHARED_BYTES, b"\0"))
        self.environment = {
            "LD_PRELOAD": str(library()),
            "FILE_CALLS_UNDER": ":".join(map(str, under)),
            "FILE_CALLS_SHARED": str(self._shared),
        }
        if is_logged:
            self._log.touch()
            self.environment["FILE_CALLS_LOG"] = str(self._log)

    def __enter__(self) -> Watch:
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def counts(self) -> dict[Kind, int]:
        """Return how often each kind was called for."""
        numbers = _COUNTS.unpack_from(self._shared.read_bytes())
        return dict(zip(Kind, numbers, strict=False))

    def failed_on(self) -> str | None:
        """Return the path of the first call that was failed; None where there was none."""
        shared = self._shared.read_bytes()
        if not _COUNTS.unpack_from(shared)[len(Kind)]:
            return None
        return shared[_COUNTS.size :].partition(b"\0")[0].decode(errors="replace")

    def calls(self) -> list[Call]:
        """Return what was written down, in order."""
        return list(_calls(self._log.read_bytes()))


def _calls(log: bytes) -> Iterator[Call]:
    at = 0
    while at < len(log):
        head = _ENTRY.unpack_from(log, at)
        size, kind, process, flags, file, offset, time_ns, path, second, data = head
        ends = [at + size]
        for length in (path, second, data):
            ends.append(ends[-1] + length)
        texts = [log[a:b] for a, b in pairwise(ends)]
        names = [text.decode(errors="surrogateescape") for text in texts[:2]]
        yield Call(Kind(kind), process, file, offset, flags, time_ns / 1e9, *names, texts[2])
        at = ends[-1]


def why_not() -> str:
    """Return why calls cannot be seen here, "" if they can."""
    if shutil.which(COMPILE[0]) is None:
        return f"{COMPILE[0]} is not installed"
    if platform.libc_ver()[0] != "glibc":
        return "what is preloaded is written for glibc"
    return ""


@functools.cache
def library() -> Path:
    """Compile what is preloaded; return where it is.

    Raises:
        RuntimeError: there is no compiler here.
    """
    if why := why_not():
        raise RuntimeError(why)
    folder = tempfile.TemporaryDirectory(prefix="file-calls-")
    atexit.register(folder.cleanup)
    built = Path(folder.name, "file_calls.so")
    words = [*COMPILE, "-o", str(built), str(SOURCE), "-ldl", "-lpthread"]
    subprocess.run(words, check=True)
    return built
