"""``check-config`` tells all that is wrong, with lines, and whether a daemon would start."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from PIL import Image

from fasaco_edge.cli import main
from fasaco_edge.config.loading import load_config
from fasaco_edge.errors import BadConfiguration
from tests.support.processes import fasaco_edge

EXAMPLE = Path(__file__).parents[2] / "deploy" / "fasaco-edge.yaml"
WRONG = """\
robot:
  radius: 0.2
  tool_width_m: 20
robots: {}
bus:
  listen: [tcp/127.0.0.1:1, 7447]
  speed_m_s: 3
  mode: dealer
  security: {tls: {colour: red}}
planner:
  ants: 9
  ants: 10
ros2: {domain: x}
"""
TOLD = [
    (2, "robot.radius", "robot.radius: unknown key; did you mean robot.radius_m?"),
    (3, "robot.tool_width_m", "robot.tool_width_m: expected a number of at most 10, got 20"),
    (4, "robots", "robots: unknown key; did you mean robot?"),
    (6, "bus.listen[1]", "bus.listen[1]: expected a text, in quotes, got 7447"),
    (7, "bus.speed_m_s", "bus.speed_m_s: unknown key; did you mean robot.speed_m_s?"),
    (8, "bus.mode", "bus.mode: expected peer, client or router, got 'dealer'"),
    (
        9,
        "bus.security.tls.colour",
        "bus.security.tls.colour: unknown key; there are root_ca, certificate, private_key",
    ),
    (12, "planner.ants", "planner.ants: is given twice, in line 11 and in line 12"),
    (13, "ros2.domain", "ros2.domain: expected a whole number, got 'x'"),
    (13, "ros2.kind", "ros2.kind: missing"),
]
TOGETHER = """\
robot: {name: a/b}
bus:
  base: /x
  listen: [tcp/0.0.0.0:1]
map: {free_at_most: 70}
planner: {ants: 1}
ros2: {kind: bridge, domain: 3, namespace: x, topics: {map: map}}
"""


@pytest.fixture
def check(tmp_path, capsys):
    def run(text, *words):
        file = tmp_path / "config.yaml"
        file.write_text(text)
        code = main(["check-config", str(file), "--json", *words])
        told = json.loads(capsys.readouterr().out)
        assert told["file"] == str(file)
        assert told["ok"] == (code == 0)
        return code, told

    return run


def test_each_fault_is_listed_with_its_line(check):
    code, told = check(WRONG)
    assert code == 78
    found = [(fault["line"], fault["key"], fault["said"]) for fault in told["faults"]]
    assert sorted(found) == TOLD


def test_all_conflicts_are_listed_at_once(check):
    code, told = check(TOGETHER)
    assert code == 78
    found = [(fault["line"], fault["key"]) for fault in told["faults"]]
    assert found == [
        *((1, "robot.name"), (3, "bus.base"), (4, "bus.listen[0]"), (5, "map.free_at_most")),
        *((6, "planner.ants"), (7, "ros2.namespace"), (7, "ros2.domain"), (7, "ros2.topics.map")),
    ]
    assert told["faults"][2]["code"] == "open_to_everyone"
    assert "bus.security.kind tls" in told["faults"][2]["hint"]


def test_one_round_names_what_is_known_of_both_kinds(check):
    """A value may be wrong, and others not go together, but not those that the first concerns."""
    wrong = "robot: {radius: 0.2, name: a/b}\nplanner: {seed: x}\nbattery: {low: 2, enough: 0.2}\n"
    apart = "map: {free_at_most: 70}\nbus: {base: /x}\nmission: {keep_out_mask: none.yaml}\n"
    code, told = check(wrong + apart)
    assert code == 78
    assert [(fault["line"], fault["key"]) for fault in told["faults"]] == [
        *((1, "robot.radius"), (1, "robot.name"), (2, "planner.seed"), (3, "battery.low")),
        *((4, "map.free_at_most"), (5, "bus.base"), (6, "mission.keep_out_mask")),
    ]


def test_one_round_names_what_is_wrong_with_every_zone(check):
    square = "polygon: [[0, 0], [4, 0], [4, 3]]"
    zones = ["{name: hall, polygon: [[0, 0], [4, 0]]}", f"{{name: hall, {square}, passes: 2}}"]
    zones += ["{name: yard, polygon: 7}", "{name: bath, polygon: [[0, 0], [4, 4], [4, 0], [0, 4]]}"]
    text = "mission:\n  keep_out: [[[1, 1], [2, 1]]]\n  dock: {x_m: 1}\n  zones:\n    - "
    code, told = check(text + "\n    - ".join(zones))
    assert code == 78
    assert [(fault["line"], fault["key"]) for fault in told["faults"]] == [
        *((2, "mission.keep_out[0]"), (3, "mission.dock.y_m")),
        *((5, "mission.zones[0].polygon"), (6, "mission.zones[1].passes")),
        *((6, "mission.zones[1].name"), (7, "mission.zones[2].polygon")),
        (8, "mission.zones[3].polygon"),
    ]


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("a: [", None, "not plain YAML"),
        ("a: &a {b: *a}", None, "not plain YAML: line 1: *a refers to nothing, or to itself"),
        ("x: &r {name: r2}\nrobot: *r", 1, "x: unknown key; there are robot, bus"),
        ("[1, 2]", None, "expected a mapping, got [1, 2]"),
        ("robot: {name: " + "x" * 9999 + "/}", 1, "robot.name: must be chunks"),
    ],
    ids=["no YAML", "in itself", "an alias", "a list", "a book"],
)
def test_a_file_without_a_configuration_is_one_fault(check, text, line, said):
    code, told = check(text)
    assert code == 78
    (fault,) = told["faults"]
    assert fault["said"].startswith(said)
    assert fault["line"] == line


def test_a_document_that_expands_when_parsed_is_refused(check):
    """A billion laughs: each list holds nine times the one before."""
    text = "a0: &a0 [lol]\n" + "".join(
        f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 12)
    )
    code, told = check(text + "robot: {name: *a11}\n")
    assert code == 78
    assert told["faults"][0]["said"].endswith("more than 50000 values, aliases written out")


def test_a_valid_configuration_is_shown_with_defaults(check, capsys):
    code, told = check("robot: {name: mower}\nbus: {connect: ['tcp/h:1#key=secret']}", "--show")
    assert (code, told["faults"]) == (0, [])
    assert told["config"]["robot"] == {
        "name": "mower",
        "radius_m": 0.18,
        "clearance_m": 0.0,
        "tool_width_m": 0.3,
        "speed_m_s": 0.25,
        "quarter_turn_s": 1.5,
        "turn_deg_s": None,
        "turn_deg_s2": 180.0,
        "acceleration_m_s2": 0.5,
        "steered_deg": 1.0,
        "overlap": 0.08,
        "turn_radius_m": 0.0,
        "reverses": True,
        "tool_ahead_m": 0.0,
        "time_scale": 1.0,
    }
    assert "secret" not in json.dumps(told["config"])
    assert main(["check-config", str(EXAMPLE), "--show"]) == 0
    assert (
        load_config(EXAMPLE).planner.ants
        == (yaml.safe_load(capsys.readouterr().out)["planner"]["ants"])
    )


def test_people_read_a_line_for_each(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text(WRONG)
    ended = fasaco_edge("check-config", file)
    assert ended.code == 78
    said = ended.out.splitlines()
    assert f"{file}:8: bus.mode: expected peer, client or router, got 'dealer'" in said
    assert len(said) == len(TOLD)
    missing = fasaco_edge("check-config", tmp_path / "none.yaml")
    assert missing.code == 78
    file = tmp_path / "none.yaml"
    assert missing.out == (
        f"{file}: No such file or directory\n"
        f"  -> name another file, or write this one: fasaco-edge init {file}\n"
    )
    good = fasaco_edge("check-config", EXAMPLE)
    assert (good.code, good.out) == (0, f"{EXAMPLE}: in order\n")


def test_the_daemon_names_all_faults(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text(WRONG)
    with pytest.raises(BadConfiguration) as refused:
        load_config(file)
    assert str(refused.value) == f"{file}, line 2: {TOLD[0][2]}"
    assert len(refused.value.rest) == len(TOLD) - 1
    ended = fasaco_edge("run", "--config", file)
    assert ended.code == 78
    assert all(f"{file}, line {line}: {said}" in ended.err for line, _, said in TOLD)


def test_the_keep_out_mask_is_read_as_the_daemon_reads_it(check, tmp_path):
    text = "robot: {name: r}\nmission:\n  keep_out_mask: mask.yaml\n"
    mask, image = tmp_path / "mask.yaml", tmp_path / "mask.png"
    checks = []
    for make in (
        lambda: None,
        lambda: mask.write_text(
            "image: mask.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        ),
        lambda: image.write_text("no image"),
        lambda: Image.new("L", (20, 20), 0).save(image),
    ):
        make()
        code, told = check(text)
        checks.append((code, [(fault["line"], fault["key"]) for fault in told["faults"]]))
        assert fasaco_edge("doctor", "--config", tmp_path / "config.yaml").out.count(
            "mission.keep_out_mask: "
        ) == len(told["faults"])
    assert checks == [(78, [(3, "mission.keep_out_mask")])] * 3 + [(0, [])]
    code, told = check(text, "--show")
    assert told["config"]["mission"]["keep_out_mask"] == "mask.yaml"


def test_a_file_that_is_no_text_is_named(tmp_path):
    (tmp_path / "robot.yaml").write_bytes(b"a: \xff")
    ended = fasaco_edge("check-config", tmp_path / "robot.yaml")
    assert ended.code == 78
    assert "not plain YAML: byte 4 is not text in UTF-8" in ended.out + ended.err
