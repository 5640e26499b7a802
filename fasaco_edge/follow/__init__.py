"""The follower of the published path: a small process of its own, without numpy.

``node`` runs the cycles on the bus. ``inputs`` passes poses, paths, heartbeats and scans on;
``daemons`` says which daemon's count, and which of several followers drives. ``supervision`` has
what makes any robot stand.

``follower`` drives a base by velocities: ``estimate`` of its pose, ``legs`` of a ``route``,
``pursuit`` along it, ``sight`` of what the map does not show, ``grip`` to see that the base moves.
``nav2`` has Nav2's controller drive ``pieces`` of the path, ``docking`` has its docking server
dock: both send goals by ``actions``. ``standstill`` reports what keeps the robot.
"""
