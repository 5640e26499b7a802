"""Figures for Prometheus: the text format, read by a parser of its own, and the server."""

from __future__ import annotations

import json
import re
import socket
import threading
import time
import urllib.error
import urllib.request
from contextlib import ExitStack, contextmanager

import pytest
from msgspec import structs

from fasaco_edge.config.config import DaemonConfig, MetricsConfig
from fasaco_edge.config.loading import inspect_config
from fasaco_edge.daemon.metrics import (
    CONTENT_TYPE,
    METRICS,
    PREFIX,
    MetricsServer,
    exposition,
    serve_metrics,
)
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.addresses import Address
from fasaco_edge.wire.documents.path_documents import PathReport
from fasaco_edge.wire.documents.replies import STATES, CoverageReport, FloorReport
from fasaco_edge.wire.documents.status import (
    BatteryReport,
    ErrorCounts,
    LoopTimes,
    Status,
    SupervisedRecorder,
)
from tests.deploy.manual import MANUAL
from tests.support.processes import free_endpoint
from tests.support.waiting import meanwhile, until

STATUS = Status(
    robot="robot",
    version="1.2",
    state="covering",
    uptime_s=12.5,
    coverage=CoverageReport(coverable=40, covered=10, fraction=0.25),
    floor=FloorReport(swept_m2=3.5),
    path=PathReport(revision=7, remaining_steps=30, gap=0.04),
    loop_ms=LoopTimes(turns=100, late=1, p50=2.0, p99=5.0, p99_9=20.0, max=250.0),
    errors=ErrorCounts(total=3, by_code={"malformed_message": 2, "wrong_frame": 1}),
    recorder=SupervisedRecorder(state="recording", restarts=1),
    rss_mb=41.5,
    cpu_s=3.25,
    threads=9,
)
# Whatever proxy the environment names.
OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}))
NAME, LABEL = "[a-zA-Z_:][a-zA-Z0-9_:]*", r'[a-zA-Z_][a-zA-Z0-9_]*="(?:[^"\\\n]|\\[\\"n])*"'
SAMPLE = re.compile(rf"({NAME})(?:\{{((?:{LABEL},?)*)\}})? (\S+)")


def parsed(text):
    """Return samples {(name, labels): value} of a text in format 0.0.4, which is checked."""
    assert text.endswith("\n")
    kinds, samples, name = {}, {}, None
    for line in text.splitlines():
        if line.startswith("# HELP "):
            name = line.split(" ")[2]
            assert name not in kinds, "all samples of a metric stand together"
            continue
        if line.startswith("# TYPE "):
            _, _, of, kind = line.split(" ")
            assert of == name
            assert kind in ("gauge", "counter", "summary")
            assert (kind == "counter") == name.endswith("_total")
            kinds[name] = kind
            continue
        found = SAMPLE.fullmatch(line)
        assert found, line
        assert found[1] == name
        labels = tuple(sorted(re.findall(LABEL, found[2] or "")))
        assert (name, labels) not in samples, "no sample twice"
        # Prometheus knows quantiles of summaries alone.
        assert (kinds[name] == "summary") == ("quantile=" in line)
        samples[name, labels] = float(found[3])
    return samples


@pytest.mark.parametrize("battery", [None, BatteryReport(level=None), BatteryReport(level=0.5)])
def test_the_charge_is_exported_if_known(battery):
    told = parsed(exposition(structs.replace(STATUS, battery=battery), 0.5))
    level = battery and battery.level
    assert told.get(("fasaco_edge_battery_ratio", ())) == level


def test_the_board_shows_figures_and_labels_that_there_are():
    board = json.loads((MANUAL.parent / "grafana.json").read_text(encoding="utf-8"))
    status = structs.replace(STATUS, battery=BatteryReport(level=0.5))
    told = parsed(exposition(status, 0.5))
    known = {name for name, _ in told} | {f"{PREFIX}_{metric.name}" for metric in METRICS}
    numbers = [panel["id"] for panel in board["panels"]]
    assert len(set(numbers)) == len(numbers) > 10
    shown = set()
    for panel in board["panels"]:
        for target in panel["targets"]:
            names = re.findall(rf"{PREFIX}_\w+", target["expr"])
            assert names
            assert set(names) <= known, panel["title"]
            shown |= set(names)
            for label in re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]):
                has = [labels for name, labels in told if name == names[0]]
                assert all(any(one.startswith(f"{label}=") for one in labels) for labels in has)
            # The first of its kind has nothing to grow from.
            if "errors_total" in target["expr"]:
                assert re.match(r"\((\S+) unless \1 offset 5m\) or increase", target["expr"])
            # A counter means something by its growth alone.
            for name in names:
                grows = f"increase({name}" in target["expr"] or f"rate({name}" in target["expr"]
                assert grows == name.endswith("_total"), target["expr"]
    assert len(shown) > 20


def test_a_status_is_exported_in_base_units():
    told = parsed(exposition(STATUS, 0.5))
    assert told["fasaco_edge_covered_ratio", ()] == 0.25
    assert told["fasaco_edge_swept_square_metres", ()] == 3.5
    assert told["fasaco_edge_path_gap_ratio", ()] == 0.04
    assert told["fasaco_edge_cycle_seconds", ('quantile="0.99"',)] == 0.005
    assert told["fasaco_edge_memory_bytes", ()] == 41_500_000
    assert told["fasaco_edge_errors_total", ('code="malformed_message"',)] == 2
    assert told["fasaco_edge_recorder_up", ()] == 1
    assert told["fasaco_edge_status_age_seconds", ()] == 0.5
    states = {labels[0]: value for (name, labels), value in told.items() if name.endswith("_state")}
    assert len(states) == len(STATES)
    assert [name for name, value in states.items() if value] == ['state="covering"']


def test_unknown_figures_are_left_out():
    told = parsed(exposition(Status(state="idle"), 0.0))
    names = {name for name, _ in told}
    assert "fasaco_edge_covered_ratio" not in names
    assert "fasaco_edge_recorder_up" not in names
    assert "fasaco_edge_latency_seconds" not in names


def test_names_do_nothing_to_the_page():
    evil = 'a"} 1\nfasaco_edge_up 1\\ \x1b[31m\u202e'
    text = exposition(structs.replace(STATUS, robot=evil), 0.0)
    told = parsed(text)
    assert ("fasaco_edge_up", ()) not in told
    assert "\x1b" not in text
    assert "\u202e" not in text


@contextmanager
def served(status=STATUS):
    port = int(free_endpoint().rpartition(":")[2])
    server = MetricsServer(Address("127.0.0.1", port))
    try:
        if status is not None:
            server.show(status)
        yield f"http://127.0.0.1:{port}"
    finally:
        server.close()


def test_a_page_is_served_and_nothing_else():
    with served() as url:
        with OPENER.open(f"{url}/metrics?x=1", timeout=60) as answer:
            assert answer.headers["Content-Type"] == CONTENT_TYPE
            assert parsed(answer.read().decode())["fasaco_edge_threads", ()] == 9
        asked = urllib.request.Request(f"{url}/metrics", method="HEAD")
        with OPENER.open(asked, timeout=60) as answer:
            assert answer.read() == b""
        for path, data, code in (("/", None, 404), ("/metrics", b"x", 405)):
            with pytest.raises(urllib.error.HTTPError) as refused:
                OPENER.open(url + path, data, timeout=60)
            assert refused.value.code == code
            refused.value.close()


def test_before_the_first_status_there_is_no_page():
    with served(None) as url:
        with pytest.raises(urllib.error.HTTPError) as refused:
            OPENER.open(f"{url}/metrics", timeout=60)
        assert refused.value.code == 503
        refused.value.close()


def test_silent_or_talkative_clients_block_no_other():
    with served() as url, ExitStack() as stack:
        address = "127.0.0.1", int(url.rpartition(":")[2])
        for said in (b"GET /metrics HTTP/1.0\r\n", b"x" * 20_000, *[b""] * 40):
            stack.enter_context(socket.create_connection(address, 60)).sendall(said)
        begun = time.monotonic()
        with OPENER.open(f"{url}/metrics", timeout=60) as answer:
            assert answer.status == 200
        assert time.monotonic() - begun < 5.0, "each of them may take a second to say something"


def test_a_flood_of_silent_connections_blocks_no_client():
    with served() as url, ExitStack() as stack:
        address = "127.0.0.1", int(url.rpartition(":")[2])

        def flood():
            for _ in range(5):
                silent = stack.enter_context(socket.socket())
                silent.setblocking(False)
                silent.connect_ex(address)

        with meanwhile(flood, 0.01):
            for _ in range(5):
                with OPENER.open(f"{url}/metrics", timeout=60) as answer:
                    assert answer.status == 200
                    assert answer.read()


def test_endless_requests_get_a_few_answers_a_second():
    with served() as url:
        address, begun, answers = ("127.0.0.1", int(url.rpartition(":")[2])), time.monotonic(), 0
        while time.monotonic() - begun < 1.0:
            with socket.create_connection(address, 60) as asking:
                asking.sendall(b"GET /metrics HTTP/1.0\r\n\r\n")
                answers += asking.recv(12) == b"HTTP/1.0 200"
        assert 1 <= answers <= 25


def test_a_taken_port_or_a_closed_server_stops_nothing(caplog):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert serve_metrics(Address(*taken.getsockname())) is None
    assert "cannot listen on 127.0.0.1" in caplog.text
    with served():
        pass
    until(lambda: all(thread.name != "metrics" for thread in threading.enumerate()))


@pytest.mark.parametrize(
    ("listen", "said"),
    [
        ("9465", "must be an address and a port"),
        ("127.0.0.1:0", "must be an address and a port"),
        ("127.0.0.1:70000", "must be an address and a port"),
        ("example.org:9465", "must be an address and a port"),
        ("0.0.0.0:9465", "lets other computers read the status"),
        ("[::]:9465", "lets other computers read the status"),
    ],
)
def test_a_wrong_address_is_a_fault_with_its_line(tmp_path, listen, said):
    file = tmp_path / "robot.yaml"
    file.write_text(f"metrics:\n  listen: '{listen}'\n")
    config, faults = inspect_config(file)
    assert config is None
    assert said in str(faults[0])
    assert faults[0].line == 2
    with pytest.raises(BadConfiguration, match=r"metrics\.listen"):
        MetricsConfig(listen=listen).address()


def test_others_may_read_if_the_address_is_open():
    assert DaemonConfig().metrics.address() is None
    assert MetricsConfig("localhost:1").address() == Address("127.0.0.1", 1)
    assert MetricsConfig("[::1]:1").address() == Address("::1", 1)
    assert MetricsConfig("0.0.0.0:1", open_to_everyone=True).address() == Address("0.0.0.0", 1)
