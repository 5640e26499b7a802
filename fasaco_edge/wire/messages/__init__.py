"""Messages of ROS in CDR: read and written."""
