"""The doctor says what is open to whom, and what to do; the exit code tells whether it is bad."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from fasaco_edge.cli import main
from fasaco_edge.doctor.finding import Check, Finding, Level
from fasaco_edge.doctor.report import CHECKS, findings
from fasaco_edge.errors import BadConfiguration
from tests.support.processes import fasaco_edge, free_endpoint
from tests.support.secured import authority, needs_openssl

OF_CONFIG = [check.name for check in CHECKS if not check.of_machine]
ON_THE_BUS = ("session", "peers")
ROLES = {"mapper": ["slam"], "operator": ["boss"]}


@pytest.fixture
def doctor(tmp_path):
    def ask(**bus):
        file = tmp_path / "config.yaml"
        file.write_text(yaml.safe_dump({"bus": bus}))
        # A process of its own: on a slow computer, where a check takes long, it ends abruptly.
        ended = fasaco_edge("doctor", "--config", file, "--json")
        told = json.loads(ended.out)
        assert told["ok"] == (ended.code == 0)
        return {check["name"]: check for check in told["checks"]}, ended.code

    return ask


@pytest.fixture
def anywhere():
    return free_endpoint().replace("127.0.0.1", "0.0.0.0")


@pytest.fixture
def ca(tmp_path):
    return authority(tmp_path / "ca", "robot")


def tls(files, **more):
    return {
        "listen": [free_endpoint().replace("tcp/127.0.0.1", "tls/0.0.0.0")],
        "security": {"kind": "tls", "tls": files, "roles": ROLES, **more},
    }


def test_without_a_file_everything_is_as_it_should_be():
    ended = fasaco_edge("doctor")
    assert "tcp/127.0.0.1:7447: from this computer, without authentication" in ended.out
    told = [line.split(maxsplit=1) for line in ended.out.splitlines() if line[0] > " "]
    # Somebody else of this computer may have the port by default.
    own = [name for name in OF_CONFIG if name not in ON_THE_BUS]
    levels = [level for level, name in told if name.startswith(tuple(own))]
    assert levels == ["ok"] * len(own)
    failed = [name for level, name in told if level == "fail"]
    assert all(name.startswith(ON_THE_BUS) for name in failed)
    assert ended.code == (1 if failed else 0)


def test_on_a_bus_of_its_own_everything_is_as_it_should_be(doctor):
    told, code = doctor(listen=[free_endpoint()])
    assert code == 0
    assert {told[name]["level"] for name in OF_CONFIG} == {"ok"}


def test_each_check_says_what_it_is_in_the_help(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["doctor", "--help"])
    told = capsys.readouterr().out
    assert all(f"\n  {check.name} " in told for check in CHECKS)


def test_an_invalid_configuration_is_a_failed_check(doctor, anywhere):
    told, code = doctor(listen=[anywhere])
    assert code == 1
    assert list(told) == ["configuration", *(check.name for check in CHECKS if check.of_machine)]
    assert told["configuration"]["level"] == "fail"
    assert "bus.open_to_everyone" in told["configuration"]["to_do"]


def test_a_configuration_with_two_faults_is_reported_in_full(doctor):
    told, _ = doctor(listen=["x"])
    assert "bus.listen[0]: 'x': no protocol" in told["configuration"]["found"]
    (other,) = told["configuration"]["details"]
    assert "bus.listen[0]: x can be reached from other computers" in other


def test_an_open_endpoint_is_a_warning(doctor, anywhere):
    told, code = doctor(listen=[anywhere], open_to_everyone=True)
    assert code == 0
    assert told["endpoints"]["level"] == "warn"
    assert "every program that can connect may send maps" in told["endpoints"]["found"]
    assert told["endpoints"]["details"] == [
        f"{anywhere}: from other computers, without authentication"
    ]


@needs_openssl
def test_certificates_in_order(doctor, ca):
    told, code = doctor(**tls(ca.files("robot")))
    assert code == 0
    # The test's certificates end soon.
    assert told["identity"]["level"] == "warn"
    assert "certificate of 'robot', ends 20" in told["identity"]["found"]
    assert "others connect to it as localhost, 127.0.0.1" in told["identity"]["details"]
    assert told["endpoints"]["level"] == told["secret files"]["level"] == "ok"
    assert told["roles"]["level"] == "ok"
    assert "operator (boss): commands the mission, and views" in told["roles"]["details"]


@needs_openssl
@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda ca, other: ca.sign("robot", days=-1), "certificate has expired"),
        (lambda ca, other: ca.files("robot") | {"root_ca": other.root}, "issuer certificate"),
        (
            lambda ca, other: (
                ca.files("robot") | {"private_key": other.files("thief")["private_key"]}
            ),
            "key values mismatch",
        ),
        (lambda ca, other: ca.files("nobody"), "nobody.pem: No such file"),
        (lambda ca, other: ca.files("robot") | {"certificate": __file__}, "not pem"),
    ],
    ids=["expired", "another CA", "another key", "no file", "no certificate"],
)
def test_certificates_that_others_would_refuse(doctor, ca, tmp_path, spoil, said):
    other = authority(tmp_path / "other", "thief")
    told, code = doctor(**tls(spoil(ca, other)))
    assert code == 1
    assert told["identity"]["level"] == "fail"
    assert said in told["identity"]["found"]
    assert "protocol/security.md" in told["identity"]["to_do"]


@needs_openssl
def test_a_client_needs_no_server_certificate(doctor, ca):
    files = ca.sign("robot", uses="clientAuth", names="DNS:robot")
    told, code = doctor(**tls(files))
    assert code == 1
    assert "unsuitable certificate purpose" in told["identity"]["found"]
    away = {"mode": "client", "listen": [], "connect": ["tls/router.example.org:7447"]}
    told, _ = doctor(**tls(files, roles={"router": ["router"]}) | away)
    assert told["identity"]["details"] == [
        "to record with --record, add 'robot' to the recorders of the router"
    ]
    assert told["identity"]["level"] != "fail"
    assert told["roles"]["level"] == "ok"
    # There is no such router.
    assert told["session"]["level"] == "fail"


@needs_openssl
@pytest.mark.parametrize(("mode", "level"), [(0o600, "ok"), (0o640, "warn"), (0o644, "fail")])
def test_a_key_that_others_can_read_is_reported(doctor, ca, mode, level):
    files = ca.files("robot")
    Path(files["private_key"]).chmod(mode)
    told, code = doctor(**tls(files))
    assert told["secret files"]["level"] == level
    assert code == (level == "fail")
    if level != "ok":
        assert told["secret files"]["to_do"] == f"chmod 600 {files['private_key']}"


def test_user_and_password(doctor, tmp_path, anywhere):
    own, dictionary = tmp_path / "own.txt", tmp_path / "all.txt"
    own.write_text("sesame\n")
    dictionary.write_text("slam:one\n")
    for file in (own, dictionary):
        file.chmod(0o600)
    who = {"name": "robot", "password_file": str(own), "dictionary_file": str(dictionary)}
    bus = {
        "listen": [anywhere],
        "security": {"kind": "user", "user": who, "roles": ROLES},
    }
    told, code = doctor(**bus)
    assert code == 0
    assert told["identity"]["found"] == "user 'robot'; boss: a role, but no password"
    assert "traffic is not encrypted" in told["endpoints"]["found"]
    dictionary.write_text("slam:one\nboss\n")
    broken, code = doctor(**bus)
    assert code == 1
    assert broken["identity"]["found"] == f"{dictionary}, line 2: no name:password"
    assert "sesame" not in json.dumps([told, broken])
    assert "one" not in broken["identity"]["details"]


def test_a_check_that_cannot_run_is_a_warning_with_a_hint():
    def look(patient):
        raise BadConfiguration("there is no home folder", hint="set one")

    (_, (_, found)) = findings(None, (Check("state", look),))
    assert found == Finding(Level.WARN, "there is no home folder", "set one")
