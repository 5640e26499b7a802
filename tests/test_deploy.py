"""What lies in deploy/ says what is true."""

from pathlib import Path

import msgspec
import yaml

from fasaco_edge.daemon.config import DaemonConfig, load_config

EXAMPLE = Path(__file__).parent.parent / "deploy" / "fasaco-edge.yaml"


def test_example_configuration_holds_every_key_with_its_default():
    written = yaml.safe_load(EXAMPLE.read_text(encoding="utf-8"))
    assert load_config(EXAMPLE) == DaemonConfig()
    assert written == msgspec.json.decode(msgspec.json.encode(DaemonConfig()))
