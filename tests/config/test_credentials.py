"""Files that a service manager lends: found by the same words in every service."""

import pytest
import yaml

from fasaco_edge.config.loading import load_config
from fasaco_edge.config.reading import with_credentials

LENT = {"CREDENTIALS_DIRECTORY": "/run/credentials/a.service"}


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("$CREDENTIALS_DIRECTORY/key.pem", "/run/credentials/a.service/key.pem"),
        ("$CREDENTIALS_DIRECTORY", "$CREDENTIALS_DIRECTORY"),
        ("/etc/$CREDENTIALS_DIRECTORY/key.pem", "/etc/$CREDENTIALS_DIRECTORY/key.pem"),
        ({"key": "$CREDENTIALS_DIRECTORY/k"}, {"key": "/run/credentials/a.service/k"}),
        (7, 7),
    ],
)
def test_the_folder_stands_in_place_of_its_name(written, read):
    assert with_credentials(written, LENT) == read
    assert with_credentials(written, {}) == written


def test_a_configuration_finds_them(tmp_path, monkeypatch):
    for name in ("ca", "cert", "key"):
        (tmp_path / name).touch()
    names = {"root_ca": "ca", "certificate": "cert", "private_key": "key"}
    tls = {key: f"$CREDENTIALS_DIRECTORY/{name}" for key, name in names.items()}
    bus = {"listen": ["tls/127.0.0.1:7447"], "security": {"kind": "tls", "tls": tls}}
    file = tmp_path / "config.yaml"
    file.write_text(yaml.safe_dump({"bus": bus}))
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    assert load_config(file).bus.security.tls.private_key == str(tmp_path / "key")
