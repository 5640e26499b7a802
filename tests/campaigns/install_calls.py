"""What an installation has written, in order, and what of it a loss of power could still take.

An installation writes tens of thousands of files. So no cut is rebuilt: at each moment at which a
name begins to count (a unit, a configuration, the mark of a complete version, the link to the
version that runs) all that it stands for has to be on the disk. Then whatever the moment of a cut,
what is found is what was there before, or the whole of what comes after.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

STRACE = ("strace", "-f", "-y", "-qq", "--seccomp-bpf", "-s", "4096", "-e")
CALLS = "trace=open,openat,creat,rename,renameat,renameat2,symlink,symlinkat"
CALLS += ",fsync,fdatasync,syncfs,sync"
PREFIX, SETTINGS, UNITS = "/opt/fasaco-edge", "/etc/fasaco-edge", "/etc/systemd/system"
MARK = "INSTALLED"

_LINE = re.compile(r"(?:\[pid +)?(\d+)\]? +(.*)")
_RESUMED = re.compile(r"<\.\.\. \w+ resumed>(.*)")
_NAMES = re.compile(r'(?:(?:AT_FDCWD|\d+)<([^>]*)>, )?"([^"]*)"')
_OPENED = re.compile(r"= \d+<([^>]*)>$")
_ON = re.compile(r"\w+\(\d+<([^>]*)>")


@dataclass
class Installation:
    """What is not on the disk yet.

    Attributes:
        dirty: files that were opened for writing since they were synchronised.
        unnamed: names that are new since their folder was.
        wrong: what a cut could have left.
        counted: names that began to count, in order.
    """

    dirty: set[str] = field(default_factory=set)
    unnamed: set[str] = field(default_factory=set)
    wrong: list[str] = field(default_factory=list)
    counted: list[str] = field(default_factory=list)

    def take(self, call: str) -> None:
        """Take a call as strace writes it."""
        name = call.partition("(")[0]
        if call.endswith(")") or " = -1 " in call:
            return
        if name in ("open", "openat", "creat"):
            opened = _OPENED.search(call)
            if opened and ("O_WRONLY" in call or "O_RDWR" in call or name == "creat"):
                self.dirty.add(opened[1])
                self.unnamed.add(opened[1])
        elif name.startswith("symlink"):
            self.unnamed.add(_absolute(*_NAMES.findall(call)[-1]))
        elif name.startswith("rename"):
            before, after = (_absolute(*found) for found in _NAMES.findall(call)[:2])
            self._renamed(before, after)
        elif name in ("sync", "syncfs"):
            self.dirty.clear()
            self.unnamed.clear()
        elif on := _ON.match(call):
            self.dirty.discard(on[1])
            self.unnamed = {path for path in self.unnamed if _folder(path) != on[1]}

    def left(self) -> list[str]:
        """Return what of the installation itself is still not on the disk."""
        return sorted(path for path in self.dirty | self.unnamed if path.startswith(
            (PREFIX, SETTINGS, UNITS)))  # fmt: skip

    def _renamed(self, before: str, after: str) -> None:
        was_dirty = before in self.dirty
        if after.startswith((PREFIX, SETTINGS, UNITS)) and _counts(after):
            self.counted.append(after)
            if was_dirty:
                self.wrong.append(f"{after} has its name, and may be empty")
            if after.endswith(f"/{MARK}"):
                within = _folder(after)
                rest = [path for path in self.dirty if path.startswith(f"{within}/")]
                if rest:
                    self.wrong.append(f"{after} is there, and {len(rest)} files may be empty")
            if after == f"{PREFIX}/current" and any(p.endswith(f"/{MARK}") for p in self.unnamed):
                self.wrong.append(f"{after} may be of a version that is not complete")
        self.dirty.discard(before)
        self.unnamed.discard(before)
        self.unnamed.add(after)
        if was_dirty:
            self.dirty.add(after)


def calls_of(lines: Iterable[str]) -> Iterator[str]:
    """Yield each call of a log of strace; those of several processes come in pieces."""
    begun: dict[str, str] = {}
    for line in lines:
        found = _LINE.match(line.rstrip("\n"))
        if not found:
            continue
        process, text = found[1], found[2]
        if resumed := _RESUMED.match(text):
            text = begun.pop(process, "") + resumed[1]
        if text.endswith("<unfinished ...>"):
            begun[process] = text.removesuffix("<unfinished ...>").rstrip()
        else:
            yield text


def _counts(path: str) -> bool:
    is_file = path.endswith((f"/{MARK}", "/config.yaml", ".service"))
    return is_file or path in (f"{PREFIX}/current", f"{PREFIX}/previous")


def _absolute(folder: str, name: str) -> str:
    return name if name.startswith("/") else f"{folder}/{name}"


def _folder(path: str) -> str:
    return path.rpartition("/")[0]
