"""Codecs of ROS messages in CDR."""
