"""Codecs of ROS messages in CDR.

A function that decodes or reads raises MalformedMessage for bytes that are no such message, or for
a value that the contract does not allow; one that encodes, for a message that would be refused.
"""
