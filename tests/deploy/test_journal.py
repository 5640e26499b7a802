"""What the journal has of the service: lines with priorities and fields, and few of them."""

from __future__ import annotations

import time

from fasaco_edge.cli.console.logs import message_id
from tests.deploy.service import Service


def test_lines_can_be_looked_for(service: Service):
    service.start()
    ready = next(line for line in service.journal() if line.get("FASACO_EVENT") == "ready")
    assert ready["PRIORITY"] == "6"
    assert ready["MESSAGE_ID"] == message_id("ready")
    assert ready["CODE_FILE"].endswith("fasaco_edge/daemon/service.py")
    assert ready["MESSAGE"].startswith("ready after")
    found = service.lab.run("journalctl", "-o", "cat", "FASACO_EVENT=ready").stdout
    assert ready["MESSAGE"] in found


def test_why_it_did_not_start_is_an_error(service: Service):
    service.configure("robot: {radius_m: -1}\n")
    service.start(fails=True)
    (failure,) = [line for line in service.journal() if line.get("FASACO_EVENT") == "failure"]
    assert (failure["PRIORITY"], failure["FASACO_CODE"]) == ("3", "bad_configuration")
    assert "robot.radius_m" in failure["MESSAGE"]


def test_a_storm_of_faults_is_a_line(service: Service):
    service.start()
    service.lab.run("/opt/fasaco-edge/current/bin/python3", "-m", "tests.deploy.mapper", "storm")
    time.sleep(1.2)  # a status is told once a second
    refused = service.ask()["errors"]["by_code"]["malformed_message"]
    service.stop()
    lines = [line for line in service.journal() if line.get("FASACO_EVENT") == "fault"]
    print(f"{refused} faults in {len(lines)} lines")
    assert refused > 100
    # The first, perhaps one in between, and at the end the count of the others.
    assert len(lines) <= 3
    assert {line["FASACO_CODE"] for line in lines} == {"malformed_message"}
    told = sum(1 + int(line.get("FASACO_SUPPRESSED", 0)) for line in lines)
    assert told == refused
