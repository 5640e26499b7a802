"""The C client, written from protocol/ alone: it reads what we read, and refuses what we refuse."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.host.resources import folder
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.maps import decode_occupancy_grid, encode_occupancy_grid
from fasaco_edge.wire.messages.poses import decode_pose
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pillared_room
from tests.wire.decoders import DECODERS
from tests.wire.facts import check_facts, facts_of
from tests.wire.mutations import mutant, seeds_of
from tests.wire.vectors import vectors

CLIENTS = folder("protocol") / "clients"
COMPILER = shutil.which("cc")
STRICT = ("-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
TYPES = sorted(DECODERS)
MUTANTS = 2000

pytestmark = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the compiled client, which any warning keeps from coming to be."""
    build = tmp_path_factory.mktemp("c")
    nothing = build / "nothing.c"
    nothing.write_text("int main(void) { return 0; }\n")
    probe = [COMPILER, *SANITIZED, "-o", str(build / "nothing"), str(nothing)]
    checked = subprocess.run(probe, capture_output=True, check=False).returncode == 0
    sources = [str(CLIENTS / "c" / name) for name in ("fasaco_json.c", "fasaco_cdr.c")]
    command = [COMPILER, *STRICT, *(SANITIZED if checked else ()), *sources, "-lm"]
    compiled = subprocess.run(
        [*command, "-o", str(build / "fasaco_json")], capture_output=True, text=True, check=False
    )
    assert compiled.returncode == 0, compiled.stderr
    return build / "fasaco_json"


def read(client: Path, messages: Sequence[tuple[str, bytes]]) -> list[dict[str, Any]]:
    sent = b"".join(f"{kind} {len(payload)}\n".encode() + payload for kind, payload in messages)
    ended = subprocess.run([str(client)], input=sent, capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, b"")
    said = [json.loads(line) for line in ended.stdout.splitlines()]
    assert len(said) == len(messages)
    return said


def test_valid_vectors_are_read(client: Path) -> None:
    valid = vectors("valid")
    assert {vector.schema for vector in valid} == set(TYPES)
    messages = [(vector.schema, vector.payload) for vector in valid]
    for said, vector in zip(read(client, messages), valid, strict=True):
        check_facts(said, vector.facts)


def test_hostile_vectors_are_refused_for_their_reason(client: Path) -> None:
    hostile = vectors("hostile")
    messages = [(vector.schema, vector.payload) for vector in hostile]
    for said, vector in zip(read(client, messages), hostile, strict=True):
        assert said.keys() == {"error"}, vector.name
        assert vector.facts["refused"] in said["error"]
        assert "got" in said["error"]


def test_every_prefix_is_refused(client: Path) -> None:
    prefixes = [
        (vector.schema, vector.payload[:size])
        for vector in vectors("valid")
        for size in range(len(vector.payload) - 4)
    ]
    assert all("error" in said for said in read(client, prefixes))


@pytest.mark.parametrize("schema", TYPES)
def test_mutants_are_read_as_we_read_them(client: Path, schema: str) -> None:
    rng, seeds = random.Random(schema), seeds_of(schema)
    mutants = [mutant(rng, seeds) for _ in range(MUTANTS)]
    refused = 0
    for payload, said in zip(mutants, read(client, [(schema, p) for p in mutants]), strict=True):
        try:
            facts = facts_of(DECODERS[schema](payload))
        except MalformedMessage as error:
            facts = {"error": str(error)}
        if facts.keys() == said.keys() == {"error"}:
            refused += 1
            continue
        assert "error" not in facts | said, f"{facts}\n{said}\n{payload.hex()}"
        check_facts(said, facts)
    assert 0 < refused < MUTANTS


def test_resolutions_are_the_same_decimals(client: Path) -> None:
    rng = np.random.default_rng(0)
    sizes = [*(2.0**power for power in range(-13, 7)), 1e-4, 100.0, 0.05, 0.3]
    sizes += np.exp(rng.uniform(np.log(1.1e-4), np.log(99.0), 500)).tolist()
    cells = np.zeros((1, 1), np.int8)
    payloads = [
        encode_occupancy_grid(OccupancyGrid(GridGeometry(1, 1, size, Pose2D(0.0, 0.0)), cells))
        for size in sizes
    ]
    said = read(client, [(schemas.OCCUPANCY_GRID, payload) for payload in payloads])
    ours = [decode_occupancy_grid(payload).geometry.resolution for payload in payloads]
    assert [each["resolution"] for each in said] == ours


def test_a_type_of_another_name_is_refused(client: Path) -> None:
    (said,) = read(client, [("geometry_msgs/msg/Pose", vectors("valid")[0].payload)])
    assert "message type must be" in said["error"]


def write_pose(client: Path, *words: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([str(client), "pose", *words], capture_output=True, check=False)


@pytest.mark.parametrize("frame", ["", "map", "Küche", "x" * 256])
def test_poses_it_writes_are_read(client: Path, frame: str) -> None:
    written = write_pose(client, frame, "1.5", "-2.25", "0.7")
    assert written.returncode == 0, written.stderr
    stamped = decode_pose(written.stdout, schemas.POSE_STAMPED)
    assert (stamped.frame, stamped.pose.x, stamped.pose.y) == (frame, 1.5, -2.25)
    assert stamped.pose.yaw == pytest.approx(0.7, abs=1e-15)


@pytest.mark.parametrize("words", [("x" * 257, "0", "0"), ("m", "nan", "0"), ("m", "0", "2.1e7")])
def test_poses_that_would_be_refused_are_not_written(client: Path, words: Any) -> None:
    written = write_pose(client, *words, "0")
    assert (written.returncode, written.stdout) == (1, b"")
    assert b"must be" in written.stderr


def test_a_live_path_is_read(client: Path, tmp_path: Path) -> None:
    """A daemon gets its pose from the client, which then reads path and status off the bus."""
    with joined_daemon(tmp_path) as (daemon, outsider):
        outsider.put("map", map_bytes(pillared_room()))
        outsider.put("pose", write_pose(client, "map", "0.75", "0.75", "0").stdout)
        outsider.wait_status(lambda status: status["state"] == "covering")
        said = listen(client, daemon.endpoint)
        facts = facts_of(DECODERS[schemas.PATH](outsider.ask("path").payload))
    assert len(facts["xy"]) > 50
    check_facts(said["xy"], facts)
    assert said["state"]["robot"] == "robot"


def test_a_bridge_without_a_bus_is_an_error() -> None:
    words = [str(CLIENTS / "bridge.py"), "--connect", free_endpoint(), "path"]
    ended = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert ended.stderr.startswith("nobody answers at tcp/127.0.0.1:")


def test_a_bridge_whose_program_ends_ends_too(tmp_path: Path) -> None:
    with daemon_process(tmp_path) as daemon, Outsider(daemon.endpoint):
        words = [str(CLIENTS / "bridge.py"), "--connect", daemon.endpoint, "status"]
        with subprocess.Popen(
            [sys.executable, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as bridge:
            assert bridge.stdout is not None
            assert bridge.stdout.readline().startswith(b"json ")
            bridge.stdout.close()
            assert bridge.wait(120) == 0
            assert bridge.stderr.read() == b""  # type: ignore[union-attr]


def listen(client: Path, endpoint: str) -> dict[str, dict[str, Any]]:
    """Return what the client says of a live robot, by a member's name: a path, a status."""
    bridge_words = [str(CLIENTS / "bridge.py"), "--connect", endpoint, "path", "status"]
    said: dict[str, dict[str, Any]] = {}
    with (
        subprocess.Popen([sys.executable, *bridge_words], stdout=subprocess.PIPE) as bridge,
        subprocess.Popen([client], stdin=bridge.stdout, stdout=subprocess.PIPE) as reading,
    ):
        try:
            while not {"xy", "state"} <= said.keys():
                heard = json.loads(reading.stdout.readline())  # type: ignore[union-attr]
                said |= dict.fromkeys(heard, heard)
        finally:
            bridge.send_signal(signal.SIGINT)
        # To its end: closed before, the client would be told that nobody reads (SIGPIPE).
        reading.communicate()
    assert (bridge.returncode, reading.returncode) == (0, 0)
    return said
