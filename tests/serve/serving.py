"""A served page as a process of its own, and a viewer of it that is no browser."""

from __future__ import annotations

import json
import struct
import subprocess
import time
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.support.outsider import TIMEOUT_S
from tests.support.processes import ENVIRONMENT, PROGRAM, free_endpoint
from tests.support.waiting import until


@dataclass
class Served:
    process: subprocess.Popen[bytes]
    address: str
    log: Path

    @property
    def url(self) -> str:
        return f"http://{self.address}/"

    def descriptors(self) -> int:
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))

    def get(self, path: str = "/", **headers: str) -> tuple[int, dict[str, str], str]:
        names = {name.replace("_", "-"): value for name, value in headers.items()}
        request = urllib.request.Request(f"http://{self.address}{path}", headers=names)
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:
                return answer.status, dict(answer.headers), answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, dict(error.headers), error.read().decode()


def served(folder: Path, endpoint: str, *words: str) -> AbstractContextManager[Served]:
    return serving(folder, "--connect", endpoint, *words)


@contextmanager
def serving(folder: Path, *words: str) -> Iterator[Served]:
    address = free_endpoint().removeprefix("tcp/")
    log = folder / f"serve-{address.rpartition(':')[2]}.log"
    command = [*PROGRAM, "serve", "--listen", address, *words]
    with log.open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, env=ENVIRONMENT)
    page = Served(process, address, log)
    try:
        until(lambda: listens(page), why=log.read_text)
        yield page
        process.terminate()
        assert process.wait(TIMEOUT_S) == 0, log.read_text()
        assert "Traceback" not in log.read_text(), log.read_text()
    finally:
        process.kill()
        process.wait()


def listens(page: Served) -> bool:
    assert page.process.poll() is None, page.log.read_text()
    try:
        return page.get()[0] == 200
    except OSError:
        return False


NO_ANSWER = "no answer from the daemon"


@dataclass
class Looker:
    """A viewer that reads all, as a page does; what came last of each kind is in ``seen``."""

    socket: ClientConnection
    seen: dict[str, Any] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)
    asked: int = 0

    def send(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def read(self) -> dict[str, Any]:
        data = self.socket.recv(TIMEOUT_S)
        if isinstance(data, str):
            message = json.loads(data)
            self.texts.append(data)
        else:
            (length,) = struct.unpack_from("<I", data)
            self.texts.append(data[4 : 4 + length].decode())
            message = json.loads(self.texts[-1])
            message["body"] = zlib.decompress(data[4 + length :])
        self.seen[message["kind"]] = message
        return message

    def wait(self, kind: str, holds: Callable[[Any], bool] = lambda _: True) -> Any:
        if kind in self.seen and holds(self.seen[kind]):
            return self.seen[kind]
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            message = self.read()
            if message["kind"] == kind and holds(message):
                return message
            assert time.monotonic() < deadline, self.seen.get(kind)

    def command(
        self, name: str, order: dict[str, Any] | None = None, **more: Any
    ) -> dict[str, Any]:
        more |= {} if order is None else {"order": order}
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            self.asked += 1
            self.send(kind="command", id=self.asked, command=name, **more)
            answer: dict[str, Any] = self.wait("answer", lambda said: said["id"] == self.asked)
            if answer["text"] != NO_ANSWER or time.monotonic() > deadline:
                return answer


@contextmanager
def looking(page: Served, token: str = "", **options: Any) -> Iterator[Looker]:
    # One that is not read for a while, as a daemon starts, goes on to answer pings.
    unbounded: dict[str, Any] = {"max_size": None, "max_queue": None, "ping_interval": None}
    url = f"ws://{page.address}/live"
    with connect(url, compression=None, open_timeout=TIMEOUT_S, **unbounded, **options) as socket:
        looker = Looker(socket)
        looker.send(kind="hello", token=token)
        yield looker
