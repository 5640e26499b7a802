"""The session templates of the contract load, and are what the daemon makes of the same words."""

from __future__ import annotations

import json
import re

import pytest
import yaml
import zenoh

from fasaco_edge.bus import access
from fasaco_edge.bus.settings import BusSettings, session_config
from fasaco_edge.config.loading import load_config
from fasaco_edge.config.security import read_client_security
from fasaco_edge.host.resources import folder

FOLDER = folder("protocol") / "config"
TEMPLATES = sorted(FOLDER.glob("*.json5"))
THERE = "/etc/fasaco-edge"
PARTS = (
    *("mode", "connect", "listen", "scouting", "timestamping", "transport"),
    *("access_control", "low_pass_filter", "downsampling"),
)
FILES = ("ca.pem", "robot.pem", "robot.key", "tablet.pem", "tablet.key", "r1.pem", "r1.key")


@pytest.fixture
def here(tmp_path):
    """A folder that stands for /etc/fasaco-edge."""
    for name in FILES:
        (tmp_path / name).write_text("PEM")
    for name in ("robot.password", "tablet.password"):
        (tmp_path / name).write_text("CHANGE-ME\n")
    (tmp_path / "users.txt").write_text("tablet:CHANGE-ME\n")
    return tmp_path


def template(name, here):
    text = (FOLDER / name).read_text().replace(THERE, str(here))
    head = text.partition("\n{")[0]
    blocks = re.split(r"^//(?! {3}).*$", head, flags=re.MULTILINE)
    (*_, words) = (block for block in blocks if block.strip())
    words = re.sub("^// {3}", "", words, flags=re.MULTILINE)
    return zenoh.Config.from_json5(text), words


def parts(config):
    return {part: json.loads(config.get_json(part)) for part in PARTS}


def test_there_is_a_template_for_each_kind_of_session():
    assert {path.stem for path in TEMPLATES} == {
        *("robot", "router", "client", "user-robot", "user-client")
    }


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.stem)
def test_it_loads_and_explains_itself(path):
    text = path.read_text()
    config = zenoh.Config.from_json5(text)
    assert json.loads(config.get_json("scouting/multicast/enabled")) is False
    assert text.startswith("// ")
    for part in re.findall(r"^  (\w+): \{$|^  (\w+): \[$", text, re.MULTILINE):
        (key,) = filter(None, part)
        assert key == "transport" or re.search(rf"//[^\n]*\n  {key}:", text), key


@pytest.mark.parametrize("name", ["robot.json5", "user-robot.json5"])
def test_a_robots_is_what_the_daemon_makes_of_its_configuration(here, name):
    config, words = template(name, here)
    file = here / "config.yaml"
    file.write_text(words)
    settings = load_config(file).bus.settings("fasaco/@v1/robot")
    ours = session_config(settings)
    assert parts(config) == parts(ours)


@pytest.mark.parametrize("name", ["client.json5", "user-client.json5"])
def test_a_clients_is_what_our_programs_make_of_their_options(here, name, monkeypatch):
    monkeypatch.chdir(here)
    config, words = template(name, here)
    (here / "me.yaml").write_text(words)
    connect = json.loads(config.get_json("connect/endpoints"))
    security = read_client_security(str(here / "me.yaml"), connect)
    ours = session_config(BusSettings("client", tuple(connect), (), security.of_client()))
    assert parts(config) == parts(ours)


def test_the_routers_grants_each_robot_its_own_keys(here):
    config, words = template("router.json5", here)
    grants = [
        access.Grant(role, [f"{begins}{name}"], f"fasaco/@v1/{name}", of=name)
        for name in ("r1", "r2")
        for role, begins in (("robot", ""), ("mapper", "slam-"))
    ]
    grants.append(access.Grant("fleet", ["r1", "r2"], "fasaco/@v1/*"))
    who = {"viewer": "tablet", "operator": "office", "recorder": "recorder"}
    grants += [access.Grant(role, [name], "fasaco/@v1/*") for role, name in who.items()]
    asked = access.access_control(grants, "cert_common_names")
    ours = zenoh.Config.from_json5(json.dumps({"access_control": asked}))
    assert parts(config)["access_control"] == parts(ours)["access_control"]
    # And the robots' configuration in its head is one.
    file = here / "r1.yaml"
    file.write_text(words)
    settings = load_config(file).bus.settings("fasaco/@v1/r1")
    session_config(settings)
    assert yaml.safe_load(words)["bus"]["security"]["roles"] == {"router": ["router"]}


def test_limits_of_the_router_are_those_of_the_daemon(here):
    """But for the keys, which are those of all robots."""
    robots, routers = (parts(template(name, here)[0]) for name in ("robot.json5", "router.json5"))
    for part in ("low_pass_filter", "downsampling"):
        said = json.dumps(robots[part]).replace("@v1/robot/", "@v1/*/")
        assert json.loads(said) == routers[part]
