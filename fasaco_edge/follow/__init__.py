"""Follower of the published path: a small process of its own, without numpy.

``node`` runs the cycles on the bus. ``inputs`` receives poses, paths, heartbeats and scans;
``daemons`` decides which daemon's path counts, and which of several followers drives.
``supervision`` has the reasons to stop that all followers share.

``follower`` drives a base by velocities: ``estimate`` of its pose, ``legs`` of a ``route``,
``pursuit`` along it, ``sight`` of what the map does not show, ``grip`` to check its motion.
``nav2`` has Nav2's controller drive ``pieces`` of the path, by goals that ``nav2_node`` sends.
``standstill`` reports what blocks the robot.
"""
