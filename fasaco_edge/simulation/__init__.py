"""A simulated robot in a building: its ``world``, drive, ``mapper`` and ``node`` on the bus.

``noisy_mapper`` makes a map as a scan matcher does, for campaigns.
"""
