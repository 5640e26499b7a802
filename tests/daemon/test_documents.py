"""What a running daemon really says, against the JSON Schemas; and a client that shares no code."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack

from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import cells_of, coverable_cells, room, show_room
from tests.wire.contract_files import PROTOCOL, load
from tests.wire.schemas import check

ORDER = {"zones": [{"name": "west", "polygon": [[0, 0], [1.5, 0], [1.5, 3], [0, 3]], "passes": 2}]}
CLIENT = PROTOCOL / "examples" / "client.py"


def say(outsider, name, payload=None):
    (reply,) = outsider.session.get(f"{outsider.prefix}/@rpc/{name}", payload=payload, timeout=60.0)
    answer = reply.ok or reply.err
    if "application/cdr" in str(answer.encoding):
        return None  # the empty path with which a daemon begins, unless it is asked before
    document = json.loads(answer.payload.to_bytes())
    schemas = {query["name"]: query["json"] for query in load("keys.yaml")["queries"]}
    check(schemas[name] if reply.ok else "error.json", document)
    return document


def test_from_the_first_status_to_the_last_each_is_one(tmp_path):
    """Through a life with all there is: orders, zones, faults, replans, the end."""
    with joined_daemon(tmp_path) as (_, outsider):
        path, commands = outsider.listen("path"), outsider.listen("command", late=False)
        for name in ("config", "version", "mission", "status", "replan", "path", "pheromone"):
            say(outsider, name)
        outsider.put("pose", b"nonsense")
        show_room(outsider, room(3.0, 3.0), 0.75, 0.75)
        path.wait(lambda heard: True)
        order = json.dumps({"command": "start", "order": ORDER}).encode()
        assert say(outsider, "mission", order)["mission"]["zones"][0]["name"] == "west"
        path.wait(lambda heard: b"west" in heard.attachment)
        assert say(outsider, "replan")["accepted"]
        outsider.wait_status(lambda status: status["ledger"]["age_s"] is not None)
        for command in ("pause", "resume", "cancel"):
            say(outsider, "mission", json.dumps({"command": command}).encode())
        outsider.wait_status(lambda status: status["state"] == "idle")
        assert len(outsider.status.heard) > 5
        for heard in outsider.status.heard:
            check("status.json", heard.json())
        for heard in path.heard:
            about = json.loads(heard.attachment)
            check("path_attachment.json", about)
            assert about["daemon"] == outsider.status.heard[-1].json()["claim"]["id"]
        for heard in commands.heard:
            check("mission.json", heard.json())
        told = [heard.json()["command"] for heard in commands.heard]
        assert told == ["start", "replan", "pause", "resume", "cancel"]


def test_the_example_s_map_outlives_a_daemon(tmp_path):
    """It puts its map once, and latched, as the contract says of mappers."""
    endpoint = free_endpoint()
    one, other = tmp_path / "one", tmp_path / "other"
    one.mkdir()
    other.mkdir()
    command = [sys.executable, str(CLIENT), endpoint]
    with ExitStack() as running:
        first = running.enter_context(ExitStack())
        first.enter_context(daemon_process(one, bus={"listen": [endpoint]}))
        with Outsider(endpoint):
            pass  # it is there
        client = running.enter_context(
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        )
        with Outsider(endpoint) as outsider:
            outsider.wait_status(lambda status: status["coverage"] is not None)
        first.close()
        # Another one, which knows nothing of the first.
        running.enter_context(daemon_process(other, bus={"listen": [endpoint]}))
        with Outsider(endpoint) as outsider:
            outsider.wait_status(lambda status: status["state"] == "waiting for pose")
            client.communicate(input="", timeout=60.0)
        assert client.returncode == 0


def test_the_example_gets_a_path_over_every_cell(tmp_path):
    lines = [line for line in CLIENT.read_text().splitlines() if line.strip()]
    assert len(lines) <= 40
    with daemon_process(tmp_path) as running:
        with Outsider(running.endpoint):
            pass  # it is there
        command = [sys.executable, str(CLIENT), running.endpoint]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as client:
            heard = [client.stdout.readline()]
            # Path 0 is the empty one with which a daemon begins.
            while heard[-1] and not heard[-1].startswith(("path; 1", "path; 2")):
                heard.append(client.stdout.readline())
            rest, _ = client.communicate(input="", timeout=60.0)
        assert client.returncode == 0
        said, *points = heard[-1].split("; ")[0], *heard[-1].split("; ")[3:]
        assert said == "path"
        visited = cells_of([[float(x) for x in point.strip("()\n").split(",")] for point in points])
        assert set(visited) == coverable_cells(room(4.0, 3.0))
        # On a busy machine the map is there before the first status.
        statuses = [line for line in heard if line.startswith("status")]
        assert statuses[0] in ("status; waiting for map\n", "status; loading\n")
        assert "Traceback" not in rest
