"""What a recorder is told: by the options of its command, or by the daemon's configuration."""

from __future__ import annotations

import argparse

from fasaco_edge.bus.session import BusSettings
from fasaco_edge.cli.arguments import client_settings
from fasaco_edge.daemon.config import load_config
from fasaco_edge.daemon.endpoints import from_here
from fasaco_edge.daemon.ros_config import RosConfig
from fasaco_edge.recording.settings import MEGABYTE, RecorderSettings, RosInput
from fasaco_edge.wire.pose_decoding import DEFAULT_FRAMES
from fasaco_edge.wire.ros_keys import RosTopic


def of_options(args: argparse.Namespace) -> RecorderSettings:
    """Return what the options of ``fasaco-edge record`` say."""
    return RecorderSettings(
        out=args.out,
        robot=args.robot,
        base=args.base,
        bus=client_settings(args),
        pose_schema=args.pose_schema,
        ros=_ros_inputs(args.ros2) if args.ros2 else (),
        frames=_frames(args.ros2),
        part_bytes=args.part_mb * MEGABYTE,
        part_s=60.0 * args.part_min,
        quota_bytes=args.quota_mb * MEGABYTE,
        least_free_bytes=args.least_free_mb * MEGABYTE,
        serve=args.serve,
    )


def of_daemon(args: argparse.Namespace) -> RecorderSettings:
    """Return what the daemon's configuration, ``args.config``, says.

    Raises:
        BadConfiguration: the file is wrong.
    """
    config = load_config(args.config)
    bus, room = config.bus, config.recording
    bus.security.warn_of_clock()
    endpoints = tuple(map(from_here, bus.listen or bus.connect))
    return RecorderSettings(
        out=args.out,
        robot=config.robot.name,
        base=bus.base,
        bus=BusSettings("client", endpoints, secured=bus.security.of_client()),
        pose_schema=config.pose.schema,
        ros=_ros_inputs(config.ros2) if config.ros2 else (),
        frames=_frames(config.ros2 or None),
        part_bytes=room.part_mb * MEGABYTE,
        part_s=60.0 * room.part_min,
        quota_bytes=room.quota_mb * MEGABYTE,
        least_free_bytes=room.least_free_mb * MEGABYTE,
        serve=args.serve,
    )


def _frames(config: RosConfig | None) -> tuple[str, str]:
    return (config.frames.map, config.frames.robot) if config else DEFAULT_FRAMES


def _ros_inputs(config: RosConfig) -> tuple[RosInput, ...]:
    def key(topic: RosTopic) -> str:
        is_bridge = config.kind == "bridge"
        return topic.bridge_key if is_bridge else topic.rmw_key(config.domain, any_hash=True)

    topics = {"map": config.map, "map_update": config.map_updates, **config.poses}
    return tuple(
        RosInput(name, key(topic), topic.schema, topic.latched, topic.depth)
        for name, topic in topics.items()
    )
