"""The line that the robot drives: between the walk over cells and the path that is published."""
