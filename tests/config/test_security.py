"""The daemon does not listen beyond its computer to those it does not know."""

from __future__ import annotations

import subprocess

import pytest
import yaml

from fasaco_edge.config.endpoints import from_here, is_local
from fasaco_edge.config.loading import load_config
from fasaco_edge.config.ros import RosConfig
from fasaco_edge.errors import BadConfiguration, OpenToEveryone
from tests.support.processes import PROGRAM

BEYOND = "tcp/0.0.0.0:7447"
TLS_FILES = {"root_ca": "ca.pem", "certificate": "own.pem", "private_key": "own.key"}
USER = {"name": "robot", "password_file": "own.txt", "dictionary_file": "all.txt"}


def load(tmp_path, **bus):
    file = tmp_path / "config.yaml"
    file.write_text(yaml.safe_dump({"bus": bus}))
    return load_config(file)


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:7447",
        "tcp/127.8.9.1:7447",
        "tcp/localhost:7447",
        "tls/LOCALHOST:7447",
        "tcp/[::1]:7447",
        "udp/127.0.0.1:7447?rel=1#iface=eth0",
        "unixsock-stream//run/fasaco.sock",
        "unixpipe//run/fasaco",
    ],
)
def test_endpoints_of_this_computer(tmp_path, endpoint):
    assert is_local(endpoint)
    assert load(tmp_path, listen=[endpoint]).bus.listen == (endpoint,)


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/0.0.0.0:7447",
        "tcp/[::]:7447",
        "tcp/10.0.0.1:7447",
        "tcp/128.0.0.1:7447",
        "tcp/[fe80::1%eth0]:7447",
        "tcp/[::ffff:10.0.0.1]:7447",
        "quic/192.168.1.1:7447",
        "tcp/robot:7447",
        "tcp/localhost.example.org:7447",
        "tcp/127.0.0.1.example.org:7447",
        "tcp/127.0.0.1@10.0.0.1:7447",
        "tcp/0:7447",
        "tcp/127.1:7447",
        "tcp/*:7447",
        "tcp/10.0.0.1:7447#127.0.0.1:7447",
        "serial//dev/ttyUSB0",
        "vsock/-1:1234",
    ],
)
def test_endpoints_beyond_this_computer(tmp_path, endpoint):
    """Whatever is not clearly this computer alone."""
    assert not is_local(endpoint)
    with pytest.raises(OpenToEveryone) as refused:
        load(tmp_path, listen=["tcp/127.0.0.1:7447", endpoint])
    assert f"bus.listen[1]: {endpoint} can be reached" in str(refused.value)
    assert "bus.open_to_everyone: true" in refused.value.hint
    opened = load(tmp_path, listen=[endpoint], open_to_everyone=True)
    assert opened.bus.open_to_everyone


@pytest.mark.parametrize(
    ("endpoint", "why"),
    [
        ("hello", "no protocol before the address"),
        ("", "no protocol before the address"),
        ("127.0.0.1:7447", "no protocol before the address"),
        ("http/robot:80", "the protocol must be one of tcp, udp, tls, quic, ws"),
        ("tcp/", "no address after tcp/"),
        ("tcp/my robot:7447", "a space in the address"),
        ("tcp/my\0robot:7447", "a space in the address"),
        ("tcp/robot", "the address must be <host>:<port>"),
        ("tcp/:7447", "the address must be <host>:<port>"),
        ("tcp/robot:door", "the port must be a number from 1 to 65535, got 'door'"),
        ("tcp/robot:0", "the port must be a number from 1 to 65535, got '0'"),
        ("tcp/robot:65536", "the port must be a number from 1 to 65535"),
        ("tcp/robot:٧٤٤٧", "the port must be a number from 1 to 65535"),
        ("tcp/robot:7447#", "nothing after #"),
        (f"tcp/{'r' * 250}:7447", "it may have at most 255 bytes, got 259"),
        ("tcp/\ud800:7447#", "nothing after #"),
        ("tcp/::1:7447", r"an IPv6 address stands in brackets, as [::1]:7447"),
    ],
)
@pytest.mark.parametrize("key", ["listen", "connect"])
def test_an_invalid_endpoint_is_refused_before_opening(tmp_path, key, endpoint, why):
    """Zenoh would try for ever to connect there, or refuse to listen without saying why."""
    with pytest.raises(BadConfiguration) as refused:
        load(tmp_path, **{"open_to_everyone": True, key: ["tcp/127.0.0.1:7447", endpoint]})
    assert f"bus.{key}[1]: {endpoint!r}: " in str(refused.value)
    assert why in str(refused.value)
    assert "as tcp/192.168.1.5:7447" in refused.value.hint


def test_a_socket_may_have_a_space_in_its_name(tmp_path):
    listen = ["unixsock-stream//run/my robot/bus.sock"]
    assert list(load(tmp_path, listen=listen).bus.listen) == listen


def test_to_connect_anywhere_opens_nothing(tmp_path):
    config = load(tmp_path, listen=[], connect=["tcp/router.example.org:7447"])
    assert config.bus.security.kind == "none"


def test_a_wildcard_listener_is_reached_at_localhost():
    assert from_here("tls/0.0.0.0:7447") == "tls/localhost:7447"
    assert from_here("tcp/[::]:7447#a") == "tcp/localhost:7447#a"
    for endpoint in ("tcp/127.0.0.1:7447", "tcp/robot:1", "unixsock-stream//run/x.sock"):
        assert from_here(endpoint) == endpoint


def test_a_daemon_that_would_be_open_to_everyone_does_not_start(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text(yaml.safe_dump({"bus": {"listen": [BEYOND]}}))
    command = [*PROGRAM, "run", "--config", str(file), "--state", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert ended.returncode == 78
    assert f"{BEYOND} can be reached from other computers" in ended.stderr
    assert "hint: choose bus.security.kind tls or user" in ended.stderr


def tls(**more):
    return {"kind": "tls", "tls": TLS_FILES, **more}


def user(**more):
    return {"kind": "user", "user": USER, **more}


@pytest.mark.parametrize(
    ("bus", "said"),
    [
        (
            {"listen": ["tls/0.0.0.0:1"], "security": {"kind": "tls"}},
            "tls.root_ca: needed with bus.security.kind tls",
        ),
        (
            {"listen": ["tls/0.0.0.0:1"], "security": {"kind": "user"}},
            "user.name: needed with bus.security.kind user",
        ),
        (
            {"security": {"kind": "user", "user": {**USER, "dictionary_file": ""}}},
            "user.dictionary_file: needed",
        ),
        ({"security": tls()}, "bus.listen[0]: tcp/127.0.0.1:7447: only tls/<host>:<port>"),
        (
            {"listen": ["tls/0.0.0.0:1"], "connect": ["tcp/10.0.0.1:1"], "security": tls()},
            "bus.connect[0]: tcp/10.0.0.1:1: only tls/<host>:<port>",
        ),
        (
            {"listen": ["tls/0.0.0.0:1"], "security": user()},
            "bus.listen[0]: tls/0.0.0.0:1: only tcp, ws",
        ),
        (
            {"listen": ["tls/0.0.0.0:1"], "security": tls(), "open_to_everyone": True},
            "bus.open_to_everyone: contradicts bus.security.kind tls",
        ),
        ({"security": {"roles": {"mapper": ["slam"]}}}, "bus.security.roles.mapper:"),
        ({"security": {"kind": "tsl"}}, "bus.security.kind: expected none, tls or user"),
        ({"security": {"roles": {"admin": []}}}, "bus.security.roles.admin: unknown key"),
        ({"security": {"roles": {"viewer": [""]}}}, "bus.security.roles.viewer[0]"),
        ({"security": {"limits": {"maps_hz": 0}}}, "bus.security.limits.maps_hz: expected"),
        (
            {
                "listen": ["tls/0.0.0.0:1"],
                "security": {"kind": "tls", "tls": {**TLS_FILES, "root_ca": "a\0b"}},
            },
            "one with a NUL",
        ),
    ],
)
def test_conflicting_security_settings_are_refused(tmp_path, bus, said):
    with pytest.raises(BadConfiguration) as refused:
        load(tmp_path, **bus)
    assert any(said in str(fault) for fault in (refused.value, *refused.value.rest))


def test_a_file_that_is_missing_is_named(tmp_path):
    config = load(tmp_path, listen=["tls/0.0.0.0:1"], security=tls())
    with pytest.raises(BadConfiguration, match=r"tls\.root_ca: ca\.pem: No such file"):
        config.bus.settings("fasaco/@v1/robot")


def test_a_password_is_read_from_its_file_and_never_shown(tmp_path):
    for name, text in (("own.txt", "sesame\n"), ("all.txt", "eye:pw\n")):
        (tmp_path / name).write_text(text)
    who = {**USER, "password_file": str(tmp_path / "own.txt")}
    who["dictionary_file"] = str(tmp_path / "all.txt")
    config = load(tmp_path, listen=[BEYOND], security={"kind": "user", "user": who})
    settings = config.bus.settings("fasaco/@v1/robot")
    assert settings.secured["transport"]["auth"]["usrpwd"]["password"] == "sesame"
    assert "sesame" not in f"{settings!r} {config!r}"
    (tmp_path / "own.txt").write_text("\n")
    with pytest.raises(BadConfiguration, match=r"own\.txt is empty"):
        config.bus.settings("fasaco/@v1/robot")


def test_a_bus_on_loopback_has_no_rules_and_no_limits(tmp_path):
    assert load(tmp_path).bus.settings("fasaco/@v1/robot").secured == {}
    opened = load(tmp_path, listen=[BEYOND], open_to_everyone=True)
    assert set(opened.bus.settings("fasaco/@v1/robot").secured) == {
        "low_pass_filter",
        "downsampling",
    }


def test_a_role_for_ros_needs_topics(tmp_path):
    with pytest.raises(BadConfiguration, match=r"roles\.ros: without a block ros2"):
        load(
            tmp_path,
            listen=["tcp/127.0.0.1:7447"],
            security={"kind": "user", "user": USER, "roles": {"ros": ["ros"]}},
        )


def test_a_recorder_may_receive_the_topics_of_ros(tmp_path):
    files = {name: tmp_path / USER[name] for name in ("password_file", "dictionary_file")}
    for file in files.values():
        file.write_text("robot:secret")
    user = USER | {name: str(file) for name, file in files.items()}
    roles = {"kind": "user", "user": user, "roles": {"recorder": ["black-box"]}}
    config = load(tmp_path, listen=["tcp/127.0.0.1:7447"], security=roles)
    ros = RosConfig(kind="bridge", namespace="/robot1")
    rules = config.bus.settings("fasaco/@v1/robot", ros).secured["access_control"]["rules"]
    heard = [rule for rule in rules if "robot1/map" in rule["key_exprs"]]
    assert any("declare_subscriber" in rule["messages"] for rule in heard)
    for rule in heard:
        assert {"robot1/tf", "robot1/tf_static"} <= set(rule["key_exprs"])
        assert "put" not in rule["messages"] or rule["flows"] == ["egress"]
