"""Mappers that come, publish a map and go: ``passing_mappers.py COUNT ENDPOINT``.

Each is a session of its own. After each a line says how many there were; every so many the process
is killed by itself, with a session open.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time

import zenoh
import zenoh.ext

from tests.support.outsider import MAP
from tests.support.rooms import map_bytes, room

KEY = "fasaco/@v1/robot/map"
# One in so many does not say goodbye.
KILLED = 25
# So long it stays after its map is out [s].
STAY_S = 0.01


def main() -> None:
    count, endpoint = int(sys.argv[1]), sys.argv[2]
    payload = map_bytes(room(4.0, 3.0))
    for number in range(1, count + 1):
        config = {
            "mode": "client",
            "connect": {"endpoints": [endpoint], "timeout_ms": 5000},
            "scouting": {"multicast": {"enabled": False}},
            "timestamping": {"enabled": True},
            "transport": {"shared_memory": {"enabled": False}},
        }
        session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        publisher = zenoh.ext.declare_advanced_publisher(
            session,
            KEY,
            encoding=zenoh.Encoding(f"application/cdr;{MAP}"),
            cache=zenoh.ext.CacheConfig(max_samples=1),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=None
            ),
            publisher_detection=True,
        )
        publisher.put(payload)
        time.sleep(STAY_S)
        print(number, flush=True)
        if number % KILLED == 0 or number == count:
            os.kill(os.getpid(), signal.SIGKILL)
        del publisher
        session.close()  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()
