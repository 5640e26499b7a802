"""The follower of the published path: a small process of its own, without numpy.

``node`` runs the cycles on the bus. ``inputs`` passes poses, paths, heartbeats and scans on;
``daemons`` says which daemon's count, and which of several followers drives. ``supervision`` has
the reasons to stop that hold for any robot.

``follower`` drives a base by velocities: ``estimate`` of its pose, ``legs`` of a ``route``,
``pursuit`` along it, ``sight`` of what the map does not show, ``grip`` to check its motion.
``nav2`` has Nav2's controller drive ``pieces`` of the path, ``docking`` has its docking server
dock: both send goals by ``actions``. ``standstill`` reports what blocks the robot.
"""
