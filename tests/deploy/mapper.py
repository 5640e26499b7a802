"""Run in a lab: gives the daemon there a hall so large that a plan of it takes for ever."""

from tests.daemon.outsider import Outsider
from tests.daemon.rooms import map_bytes, pose_bytes, room

SIZE_M = 60.0

if __name__ == "__main__":
    with Outsider("tcp/127.0.0.1:7447") as outsider:
        outsider.put("map", map_bytes(room(SIZE_M, SIZE_M)))
        outsider.put("pose", pose_bytes(0.75, 0.75))
        outsider.wait_status(lambda status: status["plan"]["planning"])
