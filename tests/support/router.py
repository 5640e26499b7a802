"""Zenoh router in a separate process, which ends with its input.

``router.py ENDPOINT [OTHER ...]``: it listens at ENDPOINT, and connects to the others.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def router_process(endpoint: str, *others: str) -> Iterator[subprocess.Popen[str]]:
    """Run a router that listens, and connects to others; kill it in the end."""
    command = [sys.executable, __file__, endpoint, *others]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "up\n"
            yield process
        finally:
            process.kill()


def main() -> None:
    import zenoh

    config = {
        "mode": "router",
        "listen": {"endpoints": sys.argv[1:2]},
        "connect": {"endpoints": sys.argv[2:]},
        "scouting": {"multicast": {"enabled": False}},
    }
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))):
        print("up", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
