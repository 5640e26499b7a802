"""Roles become rules of Zenoh; what those do is tested in tests/daemon/test_security.py."""

from __future__ import annotations

import json
import re

import pytest
import zenoh

from fasaco_edge.bus import access
from tests.wire.contract_files import CONTRACT, load

PREFIX = "fasaco/@v1/robot"
TABLE = load("keys.yaml")
KEYS, QUERIES = TABLE["keys"], TABLE["queries"]
MOST = access.SenderLimits(64_001_024, 20.0, 200.0, 20.0)


def granted(control, role, message, flow):
    """Return the topics on which a role may send a message, or have one sent to it."""
    allowed = [policy["rules"] for policy in control["policies"] if policy["subjects"] == [role]]
    rules = [rule for rule in control["rules"] if allowed and rule["id"] in allowed[0]]
    return {
        key.removeprefix(f"{PREFIX}/")
        for rule in rules
        if message in rule["messages"] and flow in rule["flows"]
        for key in rule["key_exprs"]
        if not key.endswith("/@adv/**")
    }


def control(**names):
    grants = [access.Grant(role, who, PREFIX) for role, who in names.items()]
    return access.access_control(grants, "cert_common_names")


def test_every_topic_of_the_contract_is_some_bodys():
    entries = [*KEYS, *QUERIES]
    topics = {entry["key"].removeprefix("{base}/@v1/{robot}/") for entry in entries}
    assert topics == set(access.EVERYTHING)


def test_the_readme_has_the_roles():
    shown = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", CONTRACT, re.MULTILINE))
    for role in ("mapper", "viewer", "operator", "recorder", "router"):
        speaks, _, listens = shown[role].partition(" | ")
        own = set(re.findall("`([^`]+)`", speaks))
        assert own == (set() if role == "router" else set(access.ROLES[role].speaks))
        if role in ("viewer", "operator"):
            assert set(re.findall("`([^`]+)`", listens)) == set(access.ROLES[role].listens)


@pytest.mark.parametrize(
    ("role", "name", "message"),
    [("mapper", "map", "put"), ("operator", "@rpc/mission", "query"), ("driver", "cmd_vel", "put")],
)
def test_only_one_role_and_routers_may_send_each_input(role, name, message):
    everybody = {role: [role] for role in access.ROLES}
    rules = control(**everybody)
    may = {one for one in everybody if name in granted(rules, one, message, "ingress")}
    assert may == {role, "router"}


def test_no_role_may_delete():
    rules = control(**{role: [role] for role in access.ROLES})["rules"]
    assert not any("delete" in rule["messages"] for rule in rules)


def test_a_role_without_names_is_left_out():
    rules = control(viewer=["eye"], mapper=[])
    assert [subject["id"] for subject in rules["subjects"]] == ["viewer"]
    assert rules["subjects"][0]["cert_common_names"] == ["eye"]
    assert {rule["id"] for rule in rules["rules"]} == {"viewer listens", "viewer is told"}
    assert control()["default_permission"] == "deny"
    assert control()["policies"] == []


def test_a_role_for_one_robot_is_not_valid_for_another():
    grants = [access.Grant("robot", [name], f"fasaco/@v1/{name}", of=name) for name in ("a", "b")]
    rules = access.access_control(
        [*grants, access.Grant("viewer", ["v"], "fasaco/@v1/*")], "usernames"
    )
    keys = {rule["id"]: rule["key_exprs"] for rule in rules["rules"]}
    assert keys["robot of a speaks"][0] == "fasaco/@v1/a/path"
    assert keys["robot of b speaks"][0] == "fasaco/@v1/b/path"
    assert keys["viewer listens"][0] == "fasaco/@v1/*/path"
    assert rules["policies"][1]["subjects"] == ["robot of b"]
    assert all("of b" in rule for rule in rules["policies"][1]["rules"])


def test_zenoh_accepts_the_whole_configuration():
    everybody = {role: [role] for role in access.ROLES}
    for transport in (
        access.mutual_tls("ca.pem", "own.pem", "own.key"),
        access.user_password("own", "secret", "others.txt"),
    ):
        document = {
            "transport": transport,
            "access_control": control(**everybody),
            **access.limits(PREFIX, MOST),
        }
        zenoh.Config.from_json5(json.dumps(document))


def test_updates_have_no_rate():
    """One that is lost would spoil the map, and nobody would know."""
    rules = [rule for part in access.limits(PREFIX, MOST)["downsampling"] for rule in part["rules"]]
    assert f"{PREFIX}/map" in {rule["key_expr"] for rule in rules}
    assert f"{PREFIX}/map_update" not in {rule["key_expr"] for rule in rules}
