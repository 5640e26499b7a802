"""What a loss of power leaves of files: a model of a disk that keeps only what was synchronised.

A file's bytes are on the disk once the file was synchronised, a name once its folder was; of what
came after that, anything may be there: the bytes as they are, none, zeros, as many as half of
them, those from before; the names all, none, the first few, or all but one.
"""

from __future__ import annotations

import enum
import os
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from tests.campaigns.file_calls import EMPTIED, EVERYTHING, MADE, Call, Kind


class Bytes(enum.Enum):
    """What is left of a file that was not synchronised."""

    WHOLE = "whole"
    OLD = "old"
    EMPTY = "empty"
    ZEROED = "zeroed"
    HALF = "half"
    ZERO_TAIL = "zero tail"
    """Half, and as many zeros as to be of the size it had."""
    MIXED = "mixed"
    """For each file another of these."""


class Names(enum.Enum):
    """Which names have moved that were not synchronised."""

    ALL = "all"
    NONE = "none"
    FIRST = "first"
    """The first few."""
    BUT_ONE = "but one"


@dataclass(frozen=True, slots=True, order=True)
class Cut:
    """A loss of power.

    Attributes:
        after: so many calls were done.
        bytes: what is left of files.
        names: which names have moved.
        salt: chooses where there is a choice.
    """

    after: int
    bytes: Bytes = field(compare=False)
    names: Names = field(compare=False)
    salt: int = field(compare=False)

    def __str__(self) -> str:
        return f"{self.after} calls, bytes {self.bytes.value}, names {self.names.value}"


@dataclass(slots=True)
class _File:
    """Bytes as programs see them, and as they are on the disk."""

    now: bytearray = field(default_factory=bytearray)
    kept: bytes = b""
    is_dirty: bool = False

    def left(self, how: Bytes) -> bytes:
        now, kept = bytes(self.now), self.kept
        if not self.is_dirty or how is Bytes.WHOLE:
            return now
        if how is Bytes.OLD:
            return kept
        if how is Bytes.EMPTY:
            return b""
        common = next(
            (at for at, (a, b) in enumerate(zip(now, kept, strict=False)) if a != b),
            min(len(now), len(kept)),
        )
        if how is Bytes.ZEROED:
            return now[:common].ljust(len(now), b"\0")
        half = now[: common + (len(now) - common) // 2]
        return half.ljust(len(now), b"\0") if how is Bytes.ZERO_TAIL else half


# What a name stands for: a file, the target of a link, or a folder.
_Node = _File | str | None


@dataclass(frozen=True, slots=True)
class _Move:
    """A change of names: ``name`` is taken away, ``to`` stands for ``node``."""

    name: str | None
    to: str | None
    node: _Node

    def apply(self, names: dict[str, _Node]) -> None:
        if self.name is not None:
            names.pop(self.name, None)
        if self.to is not None:
            names[self.to] = self.node

    def concerns(self, folder: str) -> bool:
        return any(name and os.path.dirname(name) == folder for name in (self.name, self.to))


class Disk:
    """Files under ``root``, which begins empty, and to which calls are done one by one."""

    def __init__(self, root: Path) -> None:
        self._root = str(root)
        self._kept: dict[str, _Node] = {self._root: None}
        self._now = dict(self._kept)
        self._moves: list[_Move] = []
        self._open: dict[int, _File] = {}
        self._had = {self._root}

    def do(self, call: Call) -> None:
        """Do what a call has done."""
        match call.kind:
            case Kind.OPEN:
                self._opened(call)
            case Kind.WRITE:
                file = self._file(call)
                end = call.offset + len(call.data)
                if len(file.now) < call.offset:
                    file.now.extend(bytes(call.offset - len(file.now)))
                file.now[call.offset : end] = call.data
                file.is_dirty = True
            case Kind.TRUNCATE:
                file = self._file(call)
                file.now.extend(bytes(max(call.offset - len(file.now), 0)))
                del file.now[call.offset :]
                file.is_dirty = True
            case Kind.SYNC:
                self._synchronised(call)
            case Kind.RENAME:
                self._renamed(call.path, call.second)
            case Kind.UNLINK:
                self._move(_Move(call.path, None, None))
            case Kind.FOLDER:
                self._move(_Move(None, call.path, None))
            case Kind.LINK:
                self._move(_Move(None, call.path, call.second))

    def write(self, cut: Cut, to: Path) -> None:
        """Write to the folder ``to`` what a cut at this moment leaves of the root."""
        rng = random.Random(f"{cut.after} {cut.salt}")
        names = self._left(cut.names, rng)
        for path in sorted(names):
            if not all(above in names for above in self._above(path)):
                continue
            place, node = to / os.path.relpath(path, self._root), names[path]
            if node is None:
                place.mkdir(exist_ok=True)
            elif isinstance(node, str):
                place.symlink_to(node)
            else:
                kinds = list(Bytes)[:-1]
                how = rng.choice(kinds) if cut.bytes is Bytes.MIXED else cut.bytes
                place.write_bytes(node.left(how))

    @property
    def moves(self) -> int:
        """How many changes of names are not on the disk."""
        return len(self._moves)

    @property
    def dirty(self) -> int:
        """How many files are not."""
        return sum(map(_is_dirty, self._now.values()))

    def _opened(self, call: Call) -> None:
        if call.flags & MADE:
            file = _File()
            self._open[call.file] = file
            self._move(_Move(None, call.path, file))
        elif call.flags & EMPTIED:
            file = self._file(call)
            file.now.clear()
            file.is_dirty = True

    def _file(self, call: Call) -> _File:
        """Return the file of a call: by its number, or, where it was there before, its name."""
        if call.file not in self._open:
            node = self._now[call.path]
            assert isinstance(node, _File), call
            self._open[call.file] = node
        return self._open[call.file]

    def _synchronised(self, call: Call) -> None:
        if call.flags & EVERYTHING:
            self._kept, self._moves = dict(self._now), []
            for node in self._now.values():
                if isinstance(node, _File):
                    _settle(node)
        elif self._now.get(call.path, "") is None:
            waiting = []
            for move in self._moves:
                if move.concerns(call.path):
                    move.apply(self._kept)
                else:
                    waiting.append(move)
            self._moves = waiting
        elif call.file in self._open or call.path in self._now:
            _settle(self._file(call))

    def _renamed(self, name: str, to: str) -> None:
        node = self._now[name]
        self._move(_Move(name, to, node))
        if node is None:
            for path in [path for path in self._now if path.startswith(f"{name}/")]:
                self._move(_Move(path, to + path[len(name) :], self._now[path]))

    def _move(self, move: _Move) -> None:
        move.apply(self._now)
        self._moves.append(move)
        if move.to is not None:
            self._had.add(move.to)

    def _left(self, how: Names, rng: random.Random) -> dict[str, _Node]:
        moves = self._moves
        if how is Names.NONE:
            moves = []
        elif how is Names.FIRST:
            moves = moves[: rng.randint(0, len(moves))]
        elif how is Names.BUT_ONE and moves:
            without = rng.randrange(len(moves))
            moves = moves[:without] + moves[without + 1 :]
        names = dict(self._kept)
        for move in moves:
            # A file whose name was never written cannot get another.
            if move.name is None or move.name in names:
                move.apply(names)
        return names

    def _above(self, path: str) -> Iterator[str]:
        while path != self._root:
            path = os.path.dirname(path)
            yield path


def _is_dirty(node: _Node) -> bool:
    return isinstance(node, _File) and node.is_dirty


def _settle(file: _File) -> None:
    file.kept, file.is_dirty = bytes(file.now), False


def cuts_of(root: Path, calls: Sequence[Call], most: int, seed: int) -> list[Cut]:
    """Return cuts after each call, in order: ``most`` of them, with as many calls as can be."""
    rng, disk, rounds = random.Random(seed), Disk(root), list[tuple[float, Cut]]()
    for after in range(len(calls) + 1):
        if after:
            disk.do(calls[after - 1])
        kinds = list(Bytes) if disk.dirty else [Bytes.WHOLE]
        moves = list(Names) if disk.moves > 1 else [Names.ALL, Names.NONE][: disk.moves + 1]
        cuts = [
            Cut(after, kind, names, len(rounds) + number)
            for number, (kind, names) in enumerate(product(kinds, moves))
        ]
        # The first round has one cut after each call, the second another.
        rng.shuffle(cuts)
        rounds += [(round_ + rng.random(), cut) for round_, cut in enumerate(cuts)]
    return sorted(cut for _, cut in sorted(rounds)[:most])
