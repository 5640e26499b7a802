"""Codecs of ROS messages in CDR.

Functions that decode or read raise MalformedMessage for bytes that are not such a message, and for
values that the contract does not allow. Functions that encode raise it for messages that a reader
would refuse.
"""
