"""What lies in deploy/ says what is true."""

import json
from pathlib import Path

import msgspec
import pytest
import yaml

from fasaco_edge.config.config import BatteryConfig, DaemonConfig, FleetConfig, ScanConfig
from fasaco_edge.config.loading import load_config
from fasaco_edge.config.ros import RosConfig

EXAMPLE = Path(__file__).parents[2] / "deploy" / "fasaco-edge.yaml"


def test_example_configuration_holds_every_key_with_its_default():
    written = yaml.safe_load(EXAMPLE.read_text(encoding="utf-8"))
    assert load_config(EXAMPLE) == DaemonConfig()
    shown = msgspec.json.decode(msgspec.json.encode(DaemonConfig()))
    assert written == shown
    # `check-config --show` has the keys in the same order.
    assert json.dumps(written) == json.dumps(shown)


@pytest.mark.parametrize(
    ("name", "default"),
    [
        ("battery", BatteryConfig()),
        ("scan", ScanConfig()),
        ("fleet", FleetConfig("building_7")),
    ],
)
def test_a_block_without_effect_has_every_key_and_default(name, default):
    block = EXAMPLE.read_text(encoding="utf-8").partition(f"\n#{name}:")[2].partition("\n\n")[0]
    lines = [line for line in block.splitlines() if line.startswith("#  ")]
    written = yaml.safe_load("\n".join(line[1:] for line in lines if line[3] != " "))
    assert written == msgspec.json.decode(msgspec.json.encode(default))


def test_the_ros_block_has_every_key_with_its_default(tmp_path):
    before, mark, block = EXAMPLE.read_text(encoding="utf-8").partition("#ros2:")
    assert all(line.startswith("#") for line in block.splitlines()[1:])
    with_ros = tmp_path / "ros.yaml"
    with_ros.write_text(before + (mark + block).replace("\n#", "\n")[1:], encoding="utf-8")
    default = RosConfig(kind="rmw_zenoh")
    assert load_config(with_ros).ros2 == default
    written = yaml.safe_load(with_ros.read_text(encoding="utf-8"))["ros2"]
    assert written == msgspec.json.decode(msgspec.json.encode(default))
