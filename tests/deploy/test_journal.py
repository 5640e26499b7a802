"""What the journal has of the service: lines with priorities, and few of them."""

from __future__ import annotations

import re
import time

from fasaco_edge.cli.console.logs import PERIOD_S
from tests.deploy.service import Service


def test_it_says_that_it_is_ready(service: Service):
    service.start()
    (ready,) = [line for line in service.journal() if line["MESSAGE"].startswith("ready after")]
    assert ready["PRIORITY"] == "6"


def test_the_reason_of_a_failed_start_is_an_error_entry(service: Service):
    service.configure("robot: {radius_m: -1}\n")
    service.start(fails=True)
    (failure,) = [line for line in service.journal() if line["PRIORITY"] == "3"]
    assert "robot.radius_m" in failure["MESSAGE"]


def test_a_storm_of_faults_is_a_line(service: Service):
    service.start()
    began = time.monotonic()
    service.lab.run("/opt/fasaco-edge/current/bin/python3", "-m", "tests.deploy.mapper", "storm")
    before, refused = -1, 0
    while before < refused:
        time.sleep(1.2)  # a status is sent once a second
        before, refused = refused, service.ask()["errors"]["by_code"]["malformed_message"]
    service.stop()
    periods = (time.monotonic() - began) / PERIOD_S
    # In a long storm there are troubles, too: that no map comes.
    lines = [line["MESSAGE"] for line in service.journal() if "CDR" in line["MESSAGE"]]
    counts = [re.search(r"\(and (\d+) more like it\)", line) for line in lines]
    print(f"{refused} faults in {len(lines)} lines")
    assert refused > 20 * len(lines)
    # The first, one in each period, and at the end the count of the others.
    assert len(lines) <= 2 + periods
    assert sum(1 + int(count[1] if count else 0) for count in counts) == refused
