"""Whatever string comes from elsewhere: no command, page, log or notify line obeys it.

Every string member of every message, by the contract's own schemas, holds an escape, a C1 control,
an override, a line end, mark-up and a script; so do tokens, recordings and the names of files.
"""

from __future__ import annotations

import functools
import json
import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
import zenoh.ext

pytest.importorskip("rerun")

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.grid.geometry import Window
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.timeline import open_timeline
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.part import RecordingPart
from fasaco_edge.samples import SampleEncoder
from fasaco_edge.serve.recorded import Playback
from fasaco_edge.text import json_line
from fasaco_edge.wire import schemas
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.messages.pheromone import encode_pheromone
from fasaco_edge.wire.query_table import RPC_NAMES
from tests.serve.serving import looking, served
from tests.support.forked import run_forked
from tests.support.outsider import Outsider
from tests.support.processes import COMMAND_S, ENVIRONMENT, PROGRAM, daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pose_bytes, room, show_room
from tests.test_text import hidden
from tests.wire.schemas import NAMES, schema

SCRIPT = "<script>alert(1)</script>"
TAINT = f"=T\x1b]0;title\x07\x1b[2J\x9b31m\x7f\u202e\u2028\u200b\nINJECTED [red]'\"&{SCRIPT}"
# What a key of Zenoh may hold.
TOKEN = "evil\x1b]0;title\x07\x9b31m\u202e\nINJECTED<script>[red]"
FILE = TAINT.replace("/", "|").replace("\x07", "") + "\udcff"
PREFIX = "fasaco/@v1/robot"
BEGAN_NS = 1_767_225_600 * 10**9


def tainted(name: str) -> Any:
    """Return a document by the schema in a file, each of its strings tainted."""
    return _tainted(schema(name), name)


def _tainted(part: Any, name: str) -> Any:
    if "$ref" in part:
        file, _, place = part["$ref"].partition("#")
        found = schema(file or name)
        for step in place.split("/")[1:]:
            found = found[step]
        return _tainted(found, file or name)
    for choice in ("anyOf", "oneOf", "allOf"):
        if choice in part:
            return _tainted(next(p for p in part[choice] if p.get("type") != "null"), name)
    kinds = part.get("type", "object" if "properties" in part else "string")
    kind = next((k for k in kinds if k != "null"), "null") if isinstance(kinds, list) else kinds
    if kind == "object":
        more = part.get("additionalProperties")
        others = {TAINT: _tainted(more, name)} if isinstance(more, dict) else {}
        return {k: _tainted(v, name) for k, v in part.get("properties", {}).items()} | others
    if kind == "array":
        items = part.get("prefixItems") or [part.get("items", {"type": "number"})]
        items *= 1 if "prefixItems" in part else max(part.get("minItems", 1), 1)
        return [_tainted(item, name) for item in items]
    plain = {"boolean": True, "null": None}
    if kind in ("number", "integer"):
        return max(part.get("minimum", 1), 1)
    return plain.get(kind, TAINT)


@functools.cache
def raw() -> re.Pattern[str]:
    """Return what finds signs that a terminal obeys or nobody sees."""
    signs = (re.escape(sign) for sign in hidden() if sign not in "\n\t")
    return re.compile("[" + "".join(signs) + "]")


def judge(said: str) -> None:
    """Check that nothing raw is in a text, and that no line of it is another's."""
    found = raw().search(said)
    assert found is None, (found, said[max(found.start() - 80, 0) : found.end() + 80])
    assert not re.search(r"^\s{0,3}INJECTED", said, re.MULTILINE), said


def run(*words: object, env: dict[str, str] | None = None) -> tuple[int, str]:
    """Run a command as a user does; judge and return what it says."""
    command = (*PROGRAM[1:], *(str(word) for word in words))
    code, out, err = run_forked(command, ENVIRONMENT | (env or {}), COMMAND_S)
    judge(out + err)
    assert "Traceback" not in out + err, out + err
    return code, out


@contextmanager
def spoofed(*, refuses: bool) -> Iterator[str]:
    """Put a daemon on the bus that answers and says nothing but taint; yield its endpoint."""
    endpoint = free_endpoint()
    settings = {
        "mode": "router",
        "listen": {"endpoints": [endpoint]},
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True},
    }
    note = json.dumps(tainted("path_attachment.json"))
    path = encode_path(np.zeros((3, 2)), np.zeros(3), TAINT, 1)
    field = ColonySnapshot(Window(0, 0, 3, 3), 0.3, np.ones((3, 3), np.float32), 0, 8, 16, 9)
    answers: dict[str, tuple[bytes, str, str | None]] = {
        "path": (path, schemas.PATH, note),
        "coverage": (map_bytes(room(1.2, 1.2), frame=TAINT), schemas.OCCUPANCY_GRID, None),
        "pheromone": (encode_pheromone(field, TAINT, 1), schemas.PHEROMONE_GRID, None),
    }
    for name, file in (("mission", "reply.json"), *((n, f"{n}.json") for n in RPC_NAMES)):
        if file in NAMES and name not in answers and file != "mission.json":
            # As JSON may say it: escaped nowhere but where it must.
            text = json.dumps(tainted(file), ensure_ascii=False)
            answers[name] = (text.encode(), "", None)
    refusal = json.dumps(tainted("error.json")).encode()
    with zenoh.open(zenoh.Config.from_json5(json.dumps(settings))) as session:
        kept: list[Any] = [
            session.liveliness().declare_token(f"{PREFIX}/alive"),
            session.liveliness().declare_token(f"fasaco/@v1/{TOKEN}/alive"),
        ]
        for name, (payload, kind, attachment) in answers.items():
            key = f"{PREFIX}/@rpc/{name}"

            def answer(query: Any, key=key, said=(payload, kind, attachment)) -> None:
                with query:
                    if refuses:
                        query.reply_err(refusal)
                        return
                    encoding = f"application/cdr;{said[1]}"
                    encoding = encoding if said[1] else "application/json"
                    query.reply(key, said[0], encoding=encoding, attachment=said[2])

            kept.append(session.declare_queryable(key, answer, complete=True))
        for topic, name, kind in (
            ("status", "status", "application/json"),
            ("path", "path", f"application/cdr;{schemas.PATH}"),
        ):
            publisher = zenoh.ext.declare_advanced_publisher(
                session,
                f"{PREFIX}/{topic}",
                cache=zenoh.ext.CacheConfig(max_samples=1),
                publisher_detection=True,
                encoding=zenoh.Encoding(kind),
            )
            publisher.put(answers[name][0], attachment=answers[name][2])
            kept.append(publisher)
        yield endpoint


@pytest.fixture(scope="module")
def spoof() -> Iterator[str]:
    with spoofed(refuses=False) as endpoint:
        yield endpoint


QUESTIONS = [
    *(("ask", name) for name in RPC_NAMES),
    ("mission", "status"),
    ("ask", "status", "--robot", "nobody", "--timeout", "2"),
    ("watch", "--once"),
]


@pytest.mark.parametrize("words", QUESTIONS, ids=[" ".join(words[:2]) for words in QUESTIONS])
def test_a_spoofed_daemon_does_nothing_to_a_terminal(spoof, words):
    run(*words, "--connect", spoof, env={"COLUMNS": "200"})


@pytest.mark.parametrize("words", [("ask", "status"), ("ask", "path"), ("mission", "status")])
def test_json_stays_json(spoof, words):
    code, said = run(*words, "--json", "--connect", spoof)
    assert code == 0
    assert json_line(TAINT)[1:-1] in said
    assert json.loads(said)


def test_a_refusal_does_nothing_to_a_terminal():
    with spoofed(refuses=True) as endpoint:
        for words in (("ask", "config"), ("ask", "replan", "--json"), ("mission", "status")):
            code, _ = run(*words, "--connect", endpoint)
            assert code == 1


def test_a_doctor_tells_of_it_without_harm(spoof, tmp_path):
    config = tmp_path / "robot.yaml"
    config.write_text(json.dumps({"bus": {"mode": "client", "listen": [], "connect": [spoof]}}))
    run("doctor", "--config", config)


def test_a_live_view_in_lines(spoof):
    words = [*PROGRAM, "watch", "--connect", spoof]
    with subprocess.Popen(words, stdout=subprocess.PIPE, env=ENVIRONMENT) as process:
        assert process.stdout is not None
        os.set_blocking(process.stdout.fileno(), False)
        said, deadline = b"", time.monotonic() + 120
        while b"INJECTED" not in said and time.monotonic() < deadline:
            said += process.stdout.read() or b""
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        process.wait(60)
    assert b"INJECTED" in said
    judge(said.decode())


def test_a_page_gets_text_that_does_nothing(spoof, tmp_path):
    """Of the daemon in messages; the page itself holds no text of anybody's."""
    pytest.importorskip("websockets")
    with served(tmp_path, spoof, "--allow-commands") as page, looking(page) as looker:
        looker.wait("events", lambda events: SCRIPT in json.dumps(events["entries"]))
        answer = looker.command("start", {"zones": [{"name": TAINT}]})
        assert "INJECTED" in answer["text"]
        for text in looker.texts:
            for said in _texts_in(json.loads(text)):
                judge(said)
        assert "INJECTED" not in page.get()[2]
        assert "innerHTML" not in page.get()[2]
    judge(page.log.read_text())


def _texts_in(part: Any) -> Iterator[str]:
    if isinstance(part, str):
        yield part
    elif isinstance(part, dict):
        for key, value in part.items():
            yield key
            yield from _texts_in(value)
    elif isinstance(part, list):
        for value in part:
            yield from _texts_in(value)


def recorded(folder: Path) -> Path:
    """Record nothing but taint; return the file."""
    file = folder / f"{FILE[:20]}-part1.rrd"
    encoder = SampleEncoder(1)
    status = json.dumps(tainted("status.json")).encode()
    note = json.dumps(tainted("path_attachment.json")).encode()
    told = (
        ("map", map_bytes(room(2.4, 1.8), frame=TAINT), b""),
        ("status", status, b""),
        ("pose", pose_bytes(0.45, 0.45, TAINT), b""),
        ("pose", pose_bytes(0.75, 0.45, TAINT), b""),
        (PATH_DIGEST, b"12345678", note),
        (TAINT, b"x", b""),
    )
    for number, (topic, payload, attachment) in enumerate(told):
        at_ns = BEGAN_NS + number * 10**9
        encoder.add(Arrival(topic, Sample(TAINT, payload, TAINT, attachment), at_ns, at_ns))
    part = RecordingPart(file, TAINT)
    rr.set_time(entities.WALL_CLOCK, timestamp=np.datetime64(BEGAN_NS, "ns"), recording=part.stream)
    for entity in (entities.MISSION_LOG, entities.BUS_LOG, entities.RECORDER_LOG):
        rr.log(entity, rr.TextLog(TAINT), recording=part.stream)
    part.write_blob(encoder.take(), BEGAN_NS)
    part.flush(30.0)
    part.close()
    return file


def test_a_recording_is_reviewed_without_harm(tmp_path):
    file = recorded(tmp_path)
    folder = tmp_path / "files"
    code, said = run("review", file, "--long", "--export", folder)
    assert code == 0
    assert "INJECTED" in said
    assert run("review", file)[0] == 0
    code, said = run("review", file, "--at", "0:03", "--point", "0.5,0.5")
    assert code == 0
    # A table cuts a word that is wider than its column.
    assert "INJECT" in said
    for table in folder.glob("*.csv"):
        judge(table.read_text(encoding="utf-8"))
        assert not re.search(r"(^|,)\"?=T", table.read_text(encoding="utf-8"), re.MULTILINE)
    assert json.loads(run("review", file, "--json")[1])["robot"] == TAINT
    assert run("review", file, "--against", file)[0] == 0
    run("replay", file)


def test_a_recording_is_served_without_harm(tmp_path):
    file = recorded(tmp_path)
    with open_timeline([file]) as timeline:
        playback = Playback(timeline, [file])
        messages = [message for _, _, message in playback.newest()] + playback.at(1e6)
    texts = [text for text in messages if isinstance(text, str)]
    assert any("INJECTED" in text for text in texts)
    for text in texts:
        for said in _texts_in(json.loads(text)):
            judge(said)


def test_names_of_files_do_nothing(tmp_path):
    odd = tmp_path / FILE
    odd.write_text(f"image: {json.dumps(TAINT)}\n{json.dumps(TAINT)}: [")
    for words in (
        ("plan", odd),
        ("check-config", odd),
        ("run", "--config", odd),
        ("review", odd),
        ("replay", odd),
        ("mission", "start", "--order", odd),
        ("ask", "status", "--security", odd),
        ("doctor", "--config", odd),
        (TAINT.replace("\x00", ""),),
    ):
        code, _ = run(*words)
        assert code != 0
    odd.write_text(json.dumps({TAINT: {TAINT: TAINT}, "robot": {"name": TAINT, TAINT: 1}}))
    for words in (("check-config", odd), ("check-config", odd, "--json"), ("run", "--config", odd)):
        assert run(*words)[0] == 78


def test_a_daemon_logs_and_notifies_in_lines_of_its_own(tmp_path):
    """In a daemon's log each line is its own; the service manager hears one line, too."""
    address = tmp_path / "notify"
    heard = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    heard.bind(str(address))
    heard.settimeout(0.05)
    env = {"NOTIFY_SOCKET": str(address)}
    with daemon_process(tmp_path, env=env) as daemon, Outsider(daemon.endpoint) as outsider:
        order = {"zones": [{"name": TAINT, "polygon": [[0, 0], [1, 0], [1, 1]]}], TAINT: TAINT}
        show_room(outsider, room(2.4, 1.8), 0.45, 0.45)
        outsider.put("pose", pose_bytes(0.45, 0.45, TAINT))
        outsider.put("map", map_bytes(room(2.4, 1.8), frame=TAINT))
        outsider.session.put(f"{outsider.prefix}/map", TAINT.encode(), encoding=TAINT)
        for asked in ({"command": "start", "order": order}, {"command": TAINT}, {TAINT: TAINT}):
            list(
                outsider.session.get(
                    f"{outsider.prefix}/@rpc/mission", payload=json.dumps(asked).encode()
                )
            )
        outsider.wait_status(lambda status: status["errors"]["total"] > 0)
    lines = []
    with heard:
        while True:
            try:
                lines.append(heard.recv(65536).decode())
            except TimeoutError:
                break
    status = [line for line in lines if line.startswith("STATUS=")]
    assert status
    for line in status:
        judge(line)
        assert "\n" not in line
    log = daemon.log_text()
    judge(log)
    for line in log.splitlines():
        assert re.match(r"(DEBUG|INFO|WARNING|ERROR|CRITICAL) \S+: |    ", line), line
