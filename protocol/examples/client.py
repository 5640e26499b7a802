"""Give a planner a map and a pose, hear of path and status: plain Zenoh; ends with its input."""

import json
import struct
import sys

import zenoh
from zenoh.ext import CacheConfig, HistoryConfig
from zenoh.ext import declare_advanced_publisher as latched
from zenoh.ext import declare_advanced_subscriber as with_history

ROBOT = "fasaco/@v1/robot"
# CDR, little endian; then a std_msgs/Header: second 1 in the frame "map".
HEADER = b"\0\1\0\0" + struct.pack("<iII4s", 1, 0, 4, b"map\0")


def show(sample: zenoh.Sample) -> None:
    payload = sample.payload.to_bytes()
    if sample.attachment is None:
        print(f"status; {json.loads(payload)['state']}\n", end="")
        return
    # In a frame of this name the first pose's x stands at byte 44, and one more every 72 bytes.
    (count,) = struct.unpack_from("<I", payload, 20)
    points = [struct.unpack_from("<2d", payload, 44 + 72 * pose) for pose in range(count)]
    about = json.loads(sample.attachment.to_bytes())
    print("; ".join(map(str, ("path", about["revision"], about["reason"], *points))) + "\n", end="")


sys.stdout.reconfigure(line_buffering=True)  # each topic has a thread: whole lines only
# Waits for a daemon that starts later.
connect = {"endpoints": sys.argv[1:] or ["tcp/127.0.0.1:7447"], "timeout_ms": -1}
link = {"mode": "client", "connect": connect}
# A latched publisher sends its samples with timestamps, which are off in Zenoh's defaults.
link["timestamping"] = {"enabled": True}
with zenoh.open(zenoh.Config.from_json5(json.dumps(link))) as session:
    newest = HistoryConfig(max_samples=1, detect_late_publishers=True)
    for topic in ("path", "status"):
        with_history(session, f"{ROBOT}/{topic}", show, history=newest)
    room = b"\x64" * 80 + (b"\x64" + bytes(78) + b"\x64") * 58 + b"\x64" * 80  # 4 x 3 m
    info = struct.pack("<iIfII4x7dI", 1, 0, 0.05, 80, 60, 0, 0, 0, 0, 0, 0, 1, len(room))
    # Kept for a daemon that starts later, or anew: the map is put once.
    kept = CacheConfig(max_samples=1)
    maps = latched(session, f"{ROBOT}/map", cache=kept, publisher_detection=True)
    maps.put(HEADER + info + room)
    session.put(f"{ROBOT}/pose", HEADER + struct.pack("<7d", 1, 1, 0, 0, 0, 0, 1))
    sys.stdin.read()
