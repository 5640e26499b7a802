"""What a recorder has left in a lab."""

from tests.deploy.lab import Lab


def recordings(lab: Lab) -> int:
    listed = lab.run("find", "/var/log/private/fasaco-edge-recorder", "-name", "*.rrd", check=False)
    return len(listed.stdout.split())
