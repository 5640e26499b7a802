"""Simulated robot in a building: its ``world``, drive, ``mapper`` and ``node`` on the bus."""
