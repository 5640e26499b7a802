"""A subscriber of all that is published, to be frozen: ``frozen.py ENDPOINT``."""

from __future__ import annotations

import sys
import time

from tests.support.outsider import Outsider


def main() -> None:
    """Listen until killed; say "listening" on standard output once a status came."""
    with Outsider(sys.argv[1]) as outsider:
        for name in ("path", "coverage", "pheromone", "status"):
            outsider.listen(name, late=name != "pheromone")
        outsider.ask_status()
        print("listening", flush=True)
        while True:
            time.sleep(1.0)


if __name__ == "__main__":
    main()
