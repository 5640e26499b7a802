"""Hands what a robot publishes to a program that reads standard input, in any language.

    python bridge.py --connect tcp/127.0.0.1:7447 path status | c/fasaco_json

For languages without a Zenoh library; all it needs itself is eclipse-zenoh. A message goes out
as a line of its type and size, then its bytes: "nav_msgs/msg/Path 1496\\n...". The type is what
the Zenoh encoding says behind "application/cdr;", or "json". Latched keys give their last
sample at once. It ends with the program, or by SIGINT; a robot that is gone is waited for.
"""

from __future__ import annotations

import argparse
import json
import queue
import sys
from contextlib import suppress
from typing import BinaryIO

import zenoh
import zenoh.ext


def message(sample: zenoh.Sample) -> bytes:
    """Return a sample as the program gets it."""
    encoding = str(sample.encoding)
    kind = "json" if encoding.startswith("application/json") else encoding.partition(";")[2]
    payload = sample.payload.to_bytes()
    return f"{kind or 'unknown'} {len(payload)}\n".encode() + payload


def pass_on(session: zenoh.Session, prefix: str, topics: list[str], to: BinaryIO) -> None:
    """Write all samples of ``topics`` to ``to``, in the order they came, until it is closed."""
    # Zenoh's threads only put samples in: a program that hangs must not hold the session.
    samples: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    history = zenoh.ext.HistoryConfig(max_samples=1, detect_late_publishers=True)
    subscribers = [
        zenoh.ext.declare_advanced_subscriber(
            session, f"{prefix}/{topic}", lambda s: samples.put(message(s)), history=history
        )
        for topic in topics
    ]
    while subscribers:
        to.write(samples.get())
        to.flush()


def main() -> None:
    """Pass on until somebody has enough."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447", metavar="ENDPOINT")
    parser.add_argument("--base", default="fasaco")
    parser.add_argument("--robot", default="robot")
    parser.add_argument("topics", nargs="+", help="path, coverage, status, ...")
    args = parser.parse_args()
    config = {
        "mode": "client",
        "connect": {"endpoints": [args.connect], "timeout_ms": 0},
        "scouting": {"multicast": {"enabled": False}},
    }
    try:
        session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
    except zenoh.ZError as error:
        sys.exit(f"nobody answers at {args.connect}: {error}")
    with session:
        with suppress(KeyboardInterrupt, BrokenPipeError):
            pass_on(session, f"{args.base}/@v1/{args.robot}", args.topics, sys.stdout.buffer)
        # Python would flush what nobody reads any more.
        sys.stdout = None


if __name__ == "__main__":
    main()
