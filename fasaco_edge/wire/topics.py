"""Table of topics: one row for each key of the contract.

Publishers, subscribers, queues, the recorder's inputs and access rules are made from these rows;
``protocol/keys.yaml``, ``protocol/qos.yaml``, the tables of ``protocol/*.md`` and the session
templates are written from them (``make contract``).
"""

from __future__ import annotations

from fasaco_edge.wire import schemas
from fasaco_edge.wire.topic_types import EVERY, NEWEST, Qos, Queues, Topic

MAP = Topic(
    name="map",
    direction="in",
    when="the map is new, or has grown or moved",
    speaker="mapper",
    listeners=("robot", "recorder", "driver"),
    schemas=(schemas.OCCUPANCY_GRID,),
    qos=Qos("data_high", cache=1),
    queues=Queues(daemon=4, recorder=NEWEST, watch=NEWEST),
    is_input=True,
    limits=("max_grid_cells", "min_resolution_m", "max_resolution_m", "max_grid_tilt", "queue_map"),
    one_publisher_s=10.0,
)
MAP_UPDATE = Topic(
    name="map_update",
    direction="in",
    when="a window of the last map has changed",
    speaker="mapper",
    listeners=("robot", "recorder", "driver"),
    schemas=(schemas.OCCUPANCY_GRID_UPDATE,),
    qos=Qos(
        "data_high",
        congestion="block",
        why="a lost update leaves the map wrong; with the map's priority both stay in order",
    ),
    queues=Queues(daemon=256, recorder=EVERY, watch=256),
    is_input=True,
    limits=("max_grid_cells", "queue_map_update"),
)
POSE = Topic(
    name="pose",
    direction="in",
    when="the robot has a new pose in the frame of the map",
    speaker="mapper",
    listeners=("robot", "recorder", "driver"),
    schemas=schemas.POSE_SCHEMAS,
    qos=Qos("interactive_low", express=True, why="the next pose is better than a late one"),
    queues=Queues(daemon=1024, recorder=NEWEST, watch=NEWEST),
    is_input=True,
    limits=("max_coordinate_m", "quaternion_tolerance", "queue_pose"),
    one_publisher_s=3.0,
)
BATTERY = Topic(
    name="battery",
    direction="in",
    when="the battery's charge is measured, a few times a minute at least",
    speaker="mapper",
    listeners=("robot", "recorder"),
    schemas=(schemas.BATTERY_STATE,),
    qos=Qos("interactive_low"),
    queues=Queues(daemon=16, recorder=NEWEST),
    is_input=True,
    limits=("max_pose_bytes", "queue_battery"),
    one_publisher_s=60.0,
)
KEEP_OUT_MASK = Topic(
    name="keep_out_mask",
    direction="in",
    when="the areas that the robot must not touch have changed; only if the configuration has "
    "`mission.keep_out_topic`",
    speaker="mapper",
    listeners=("robot",),
    schemas=(schemas.OCCUPANCY_GRID,),
    qos=Qos("data_low", cache=1),
    limits=("max_grid_cells", "max_grid_tilt"),
    one_publisher_s=10.0,
)
PRIORITY = Topic(
    name="priority",
    direction="in",
    when="the priorities of floor have changed, for example by a map of dirt",
    speaker="mapper",
    listeners=("robot", "recorder"),
    schemas=(schemas.OCCUPANCY_GRID,),
    qos=Qos("data_low", cache=1),
    queues=Queues(daemon=2, recorder=NEWEST),
    is_input=True,
    limits=(
        *("max_priority_bytes", "min_resolution_m", "max_resolution_m", "max_grid_tilt"),
        "queue_priority",
    ),
    one_publisher_s=60.0,
)
SCAN = Topic(
    name="scan",
    direction="in",
    when="each turn of the robot's lidar, five times a second at least; only where the "
    "configuration has a block `scan`",
    speaker="mapper",
    listeners=("driver",),
    schemas=(schemas.LASER_SCAN,),
    qos=Qos("interactive_low", express=True, why="as a pose"),
    limits=("max_scan_beams", "max_scan_span_rad"),
    one_publisher_s=1.0,
)
PATH = Topic(
    name="path",
    direction="out",
    when="the walk still to be driven has changed",
    speaker="robot",
    listeners=("viewer",),
    schemas=(schemas.PATH,),
    attachment="path_attachment.json",
    qos=Qos(
        "interactive_high", express=True, cache=1, why="a frozen receiver never blocks the daemon"
    ),
    queues=Queues(recorder=EVERY, watch=64),
    limits=("max_path_poses", "max_coordinate_m"),
)
COVERAGE = Topic(
    name="coverage",
    direction="out",
    when="the coverage has changed, twice a second at most",
    speaker="robot",
    listeners=("viewer",),
    schemas=(schemas.OCCUPANCY_GRID,),
    qos=Qos("data_low", cache=1),
    queues=Queues(watch=NEWEST),
    limits=("max_grid_cells",),
)
FLOOR = Topic(
    name="floor",
    direction="out",
    when="floor was swept, every two seconds at most; repeated after ten seconds without a change; "
    "only while there is a subscriber",
    speaker="robot",
    listeners=("viewer",),
    schemas=(schemas.OCCUPANCY_GRID,),
    qos=Qos("data_low", why="for display: late joiners get it within two seconds"),
    queues=Queues(recorder=NEWEST, watch=NEWEST),
    limits=("max_grid_cells",),
)
UNSWEPT = Topic(
    name="unswept",
    direction="out",
    when="floor was swept, or the reason why it is unswept has changed, every two seconds at most; "
    "repeated after ten seconds without a change; only while there is a subscriber",
    speaker="robot",
    listeners=("viewer",),
    schemas=(schemas.OCCUPANCY_GRID,),
    qos=Qos("data_low", why="for display: late joiners get it within two seconds"),
    queues=Queues(watch=NEWEST),
    limits=("max_grid_cells",),
)
PHEROMONE = Topic(
    name="pheromone",
    direction="out",
    when="the trail has changed, twice a second at most; repeated after ten seconds without a "
    "change; only while there is a subscriber",
    speaker="robot",
    listeners=("viewer",),
    schemas=(schemas.PHEROMONE_GRID,),
    attachment="trail_attachment.json",
    qos=Qos("background", cache=1, why="for display: never before a path"),
    queues=Queues(recorder=NEWEST, watch=NEWEST),
    limits=("max_grid_cells",),
)
DIRECTIONS = Topic(
    name="directions",
    direction="out",
    when="each time `pheromone` is published, only while there is a subscriber",
    speaker="robot",
    listeners=("viewer",),
    schemas=(schemas.OCCUPANCY_GRID,),
    qos=Qos("background", cache=1, why="as the pheromone"),
    limits=("max_grid_cells",),
)
ROOMS = Topic(
    name="rooms",
    direction="out",
    when="rooms have changed, once a second at most, or were swept, every five seconds at most",
    speaker="robot",
    listeners=("viewer",),
    json="rooms.json",
    qos=Qos("data_low", cache=1),
    queues=Queues(recorder=NEWEST, watch=NEWEST),
    limits=("max_json_bytes",),
)
STATUS = Topic(
    name="status",
    direction="out",
    when="the status has changed",
    speaker="robot",
    listeners=("viewer",),
    json="status.json",
    qos=Qos("interactive_low", cache=1),
    rate_hz=1.0,
    queues=Queues(recorder=NEWEST, watch=64),
    limits=("max_json_bytes",),
)
COMMAND = Topic(
    name="command",
    direction="out",
    when="the mission has accepted a command",
    speaker="robot",
    listeners=("operator", "recorder"),
    json="mission.json",
    qos=Qos("interactive_low"),
    queues=Queues(recorder=EVERY, watch=16),
    is_input=True,
    limits=("max_json_bytes",),
)
TURNS = Topic(
    name="turns",
    direction="out",
    when="the loop has run, twice a second at most; only for a subscriber that receives "
    "the log complete, from the loop's first cycle on",
    speaker="robot",
    listeners=("recorder",),
    json="turns.json",
    qos=Qos("data_low"),
    queues=Queues(recorder=EVERY),
    is_input=True,
    limits=("max_json_bytes",),
)
FLEET = Topic(
    name="fleet",
    direction="out",
    when="once a second, on change, and four times a second near another robot; only in a fleet",
    speaker="robot",
    # Robots share an area by these messages: each subscribes to the keys of the others.
    listeners=("fleet", "viewer"),
    json="fleet.json",
    qos=Qos("data_low", why="the next message repeats all of it, within a second"),
    rate_hz=1.0,
    queues=Queues(daemon=64),
    limits=(
        *("max_json_bytes", "min_resolution_m", "max_resolution_m", "max_fleet_tiles"),
        *("max_fleet_parts", "max_fleet_index", "max_fleet_points", "queue_fleet"),
    ),
)
ALIVE = Topic(
    name="alive",
    direction="liveliness token",
    when="exists while the daemon is able to plan",
    speaker="robot",
    listeners=("viewer",),
)
CLAIM = Topic(
    name="claim",
    direction="liveliness token",
    when="each daemon of this name has one; its key says whether it plans or waits",
    speaker="robot",
    # The daemons of one name find each other by these.
    listeners=("viewer", "robot"),
    key="claim/*/*",
)
RECORDER = Topic(
    name="recorder",
    direction="out, by the recorder",
    when="the recorder's status has changed",
    speaker="recorder",
    listeners=("robot", "recorder"),
    json="recorder.json",
    qos=Qos("data", cache=1),
    rate_hz=1.0,
    queues=Queues(daemon=NEWEST),
    limits=("max_json_bytes",),
)
RECORDER_ALIVE = Topic(
    name="recorder_alive",
    direction="liveliness token",
    when="exists while a recorder listens",
    speaker="recorder",
    listeners=("robot", "recorder"),
    key="recorder/alive",
)
CMD_VEL = Topic(
    name="cmd_vel",
    direction="out, by the follower",
    when="20 times a second while the follower drives, and for a second after it has stopped",
    speaker="driver",
    listeners=("viewer",),
    schemas=schemas.TWIST_SCHEMAS,
    qos=Qos("interactive_high", express=True, why="the next velocity is better than a late one"),
)
BLOCKED = Topic(
    name="blocked",
    direction="out, by the follower",
    when="once a second while the follower cannot drive along its path, some seconds after it has "
    "stopped",
    speaker="driver",
    listeners=("robot", "viewer"),
    json="blocked.json",
    qos=Qos("interactive_low"),
    queues=Queues(daemon=16, recorder=EVERY),
    is_input=True,
    limits=(
        *("max_blocked_bytes", "max_string_bytes", "max_coordinate_m"),
        *("max_blocked_points", "queue_blocked"),
    ),
)
DRIVER = Topic(
    name="driver",
    direction="liveliness token",
    when="each follower of this robot has one; its key says whether it drives or waits",
    speaker="driver",
    # The followers of one robot find each other by these.
    listeners=("viewer",),
    key="driver/*/*",
)

TOPICS = tuple(each for each in tuple(globals().values()) if isinstance(each, Topic))
"""All rows, in the order of this file."""
# The turn log is last: once the daemon sees a subscriber to it, the recorder already receives all
# other topics.
RECORDED = (
    *(each for each in TOPICS if each.queues.recorder is not None and each is not TURNS),
    TURNS,
)
"""Topics that a recorder subscribes to, in this order."""
# Samples of these topics keep their publisher's order: an update changes the previous map.
IN_ORDER = frozenset({MAP.name, MAP_UPDATE.name})
QOS = {topic.name: topic.qos for topic in TOPICS if topic.qos is not None}

TF_STATIC = "tf_static"
"""Name of the static transforms of ROS 2 in queues and recordings."""


def _queue_lengths() -> dict[str, int]:
    lengths = dict[str, int]()
    for topic in TOPICS:
        if topic is POSE:
            # Only in ROS 2; taken before the poses that need them.
            lengths[TF_STATIC] = 256
        if topic.queues.daemon is not None and topic.queues.daemon > NEWEST:
            lengths[topic.name] = topic.queues.daemon
    return lengths | {COMMAND.name: 16}


QUEUE_LENGTHS = _queue_lengths()
"""Lengths of the daemon's queues, in the order in which its loop takes samples from them; commands
come as queries."""

RECORDED_INPUTS = (*(topic.name for topic in TOPICS if topic.is_input), TF_STATIC)
