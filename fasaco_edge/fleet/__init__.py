"""Fleets: several robots that share one area. A single robot does not use it.

mission/kind         what a robot of a fleet uses in place of ``mission.company_kind``
mission/layer        the other robots, and this one's part of the remaining area
mission/giving_way   when the robot waits for other robots, and makes way for them
mission/shared       cells that the others have swept
mission/division     who sweeps what, while a mission goes on
mission/message      what this robot sends to the others

daemon/exchange      the messages of a fleet, received and sent
observer             a fleet as recorders and watchers see it
recording            one recording of all robots
watch, review        a table in a terminal; the report of a recording
cli                  the parts of the commands that concern a fleet
"""
