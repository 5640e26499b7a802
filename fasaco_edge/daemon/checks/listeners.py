"""Who listens at an endpoint, found out without Zenoh."""

from __future__ import annotations

import re
import socket
from pathlib import Path

from fasaco_edge.daemon.endpoints import from_here, host_of, protocol_of

ANSWER_S = 0.5
LISTENING = "0A"  # proc(5), /proc/net/tcp
STREAMS = ("tcp", "tls", "ws")


def address_of(endpoint: str) -> tuple[str, int] | None:
    """Return where a TCP connection reaches an endpoint from here; None where none does."""
    if protocol_of(endpoint) not in STREAMS:
        return None
    port = re.search(r":(\d+)(?:[?#]|$)", endpoint)
    here = from_here(endpoint)
    return (host_of(here), int(port[1])) if port else None


def answers(endpoint: str) -> bool | None:
    """Tell whether somebody listens at an endpoint; None where that cannot be found out."""
    address = address_of(endpoint)
    if address is None:
        return None
    try:
        socket.create_connection(address, timeout=ANSWER_S).close()
    except OSError:
        return False
    return True


def why_not_bound(endpoint: str) -> str:
    """Return why nobody could listen at an endpoint of this computer; "" where one could."""
    address = address_of(endpoint)
    if address is None:
        return ""
    host, port = host_of(endpoint), address[1]
    try:
        place = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(place[0], place[1]) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place[4])
    except OSError as error:
        return error.strerror or str(error)
    return ""


def program_at(endpoint: str, root: Path = Path("/")) -> str:
    """Return the name and process of the program that listens at an endpoint of this computer.

    "" where it cannot be seen: those of other users only root sees.
    """
    address = address_of(endpoint)
    inodes = _listening(root, address[1]) if address else set()
    sockets = {f"socket:[{inode}]" for inode in inodes}
    for process in (root / "proc").glob("[0-9]*") if sockets else ():
        try:
            held = {str(file.readlink()) for file in (process / "fd").iterdir()}
            if held & sockets:
                name = (process / "comm").read_text(encoding="utf-8").strip()
                return f"{name}, process {process.name}"
        except OSError:
            continue
    return ""


def _listening(root: Path, port: int) -> set[str]:
    """Return the inodes of the sockets that listen at a port."""
    inodes = set()
    for table in ("tcp", "tcp6"):
        try:
            lines = (root / "proc/net" / table).read_text(encoding="ascii").splitlines()[1:]
        except OSError:
            continue
        for fields in map(str.split, lines):
            if fields[3] == LISTENING and int(fields[1].rpartition(":")[2], 16) == port:
                inodes.add(fields[9])
    return inodes
