"""Line that the robot drives: between the walk over cells and the published path."""
