"""Process of a planner of the user's own: problems in, walks or failures out.

``python -m fasaco_edge.planners.own.child PLACE FD``, with a socket at FD. A message is its length
as 8 bytes and its content: a pickled ``GridProblem`` in; out a letter and the walk's cells, int32
(n, 2), or a text. ``planners.own.process`` is the other end.
"""

from __future__ import annotations

import ctypes
import pickle
import resource
import signal
import socket
import struct
import sys
from contextlib import suppress

import numpy as np

from fasaco_edge.errors import BadConfiguration, IllegalWalk, PlannerFailed
from fasaco_edge.planners.own.loading import load
from fasaco_edge.planners.own.problem import walked

LENGTH = struct.Struct("<Q")
WALK = b"w"
# Letters of errors.
FAILURES: dict[bytes, type[BadConfiguration | IllegalWalk | PlannerFailed]] = {
    b"c": BadConfiguration,
    b"i": IllegalWalk,
    b"p": PlannerFailed,
}
KEY = "planner.own:"
# Limit on memory that the user's code asks for [bytes]; a service may forbid to set one.
MOST_BYTES = 512 * 1024 * 1024
_PR_SET_PDEATHSIG = 1


def main(place: str, file: str) -> None:
    """Answer problems until the other end closes."""
    # A walk that never ends ends with the thread that waits for it.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))
    other = socket.socket(fileno=int(file))
    code = None
    while problem := _received(other):
        try:
            code = code or load(place, KEY, is_trusted=True)
            answer = WALK + np.ascontiguousarray(walked(code, pickle.loads(problem))).tobytes()
        except (BadConfiguration, IllegalWalk, PlannerFailed) as error:
            letter = next(key for key, kind in FAILURES.items() if isinstance(error, kind))
            answer = letter + str(error).encode(errors="replace")
        other.sendall(LENGTH.pack(len(answer)) + answer)


def _received(other: socket.socket) -> bytes:
    """Return the next message; empty at the end."""
    head = _exactly(other, LENGTH.size)
    return _exactly(other, LENGTH.unpack(head)[0]) if head else b""


def _exactly(other: socket.socket, size: int) -> bytes:
    parts = bytearray()
    while len(parts) < size:
        part = other.recv(min(size - len(parts), 1 << 20))
        if not part:
            return b""
        parts += part
    return bytes(parts)


if __name__ == "__main__":
    main(*sys.argv[1:])
