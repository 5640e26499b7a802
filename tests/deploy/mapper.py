"""Run in a lab: talks to the daemon there.

``hall`` gives it a hall so large that a plan takes for ever, ``storm`` two thousand broken poses.
"""

import sys
import time

from tests.support.outsider import Outsider
from tests.support.rooms import room, show_room

SIZE_M = 60.0
STORM = 2000


def give_hall(outsider: Outsider) -> None:
    show_room(outsider, room(SIZE_M, SIZE_M), 0.75, 0.75)
    outsider.wait_status(lambda status: status["plan"]["planning"])


def storm(outsider: Outsider) -> None:
    for number in range(STORM):
        outsider.put("pose", b"no pose %d" % number)
        time.sleep(0.001)


if __name__ == "__main__":
    with Outsider("tcp/127.0.0.1:7447") as client:
        {"hall": give_hall, "storm": storm}[sys.argv[1]](client)
