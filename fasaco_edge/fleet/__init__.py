"""Fleets: several robots that share one area. A single robot does not use this package.

mission/kind         the parts of a mission that replace those of a single robot
mission/layer        the other robots, and this robot's part of the remaining area
mission/giving_way   when the robot waits for other robots, and makes way for them
mission/shared       cells that the others have swept
mission/division     which robot sweeps which of the remaining cells
mission/message      what this robot sends to the others

daemon/exchange      the messages of a fleet, received and sent
observer             a fleet as recorders and watchers see it
recording            one recording of all robots
watch, review        a table in a terminal; the report of a recording
cli                  the parts of the commands that concern a fleet
"""
