"""Keys out of everybody's reach: lent by systemd, as deploy/drop-ins/tls.conf says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.deploy.recordings import recordings
from tests.deploy.service import UNITS, Service, wait_for
from tests.support.secured import authority, needs_openssl

LENT = {
    "root_ca": "$CREDENTIALS_DIRECTORY/ca.pem",
    "certificate": "$CREDENTIALS_DIRECTORY/cert.pem",
    "private_key": "$CREDENTIALS_DIRECTORY/key.pem",
}
SECURED = {
    "listen": ["tls/127.0.0.1:7447"],
    "security": {"kind": "tls", "tls": LENT, "roles": {"recorder": ["recorder"]}},
}
KEPT = "/etc/fasaco-edge/tls"


def install(service: Service, files: dict[str, str], folder: str = KEPT) -> None:
    names = {"root_ca": "ca.pem", "certificate": "cert.pem", "private_key": "key.pem"}
    for key, name in names.items():
        service.lab.write(f"{folder}/{name}", Path(files[key]).read_text())
    service.lab.run("chmod", "-R", "go=", folder)
    drop_in = (UNITS / "drop-ins/tls.conf").read_text()
    service.drop_in("tls", drop_in.replace(KEPT, folder))


@needs_openssl
def test_daemon_and_recorder_each_have_their_own(service: Service, tmp_path):
    pytest.importorskip("rerun")
    recorder = Service(service.lab, "fasaco-edge-recorder")
    ca = authority(tmp_path / "ca", "robot", "recorder")
    install(service, ca.files("robot"))
    install(recorder, ca.files("recorder"), f"{KEPT}-recorder")
    service.configure(bus=SECURED)
    try:
        service.start()
        recorder.start()
        wait_for(lambda: recordings(service.lab) == 1, 15.0, "a recording")
        assert recorder.show("NRestarts") == "0"
    finally:
        recorder.remove()


@needs_openssl
def test_without_them_it_says_which_is_missing(service: Service):
    service.configure(bus=SECURED)
    service.start(fails=True)
    assert service.show("ExecMainStatus") == "78"
    assert "$CREDENTIALS_DIRECTORY/ca.pem: No such file" in service.text()
