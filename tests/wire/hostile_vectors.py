"""Payloads every decoder must refuse: valid ones with one thing wrong, and what that is."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from fasaco_edge.wire import schemas
from tests.wire import oracle
from tests.wire.valid_vectors import (
    CELLS,
    FLOATS,
    GEOMETRY,
    ORIGIN,
    ROBOT,
    STAMP_NS,
    Vector,
    pheromone_bytes,
)

# Offsets into a grid or pose in frame "map": header 4, stamp 8, frame 8; then come
# load time 8, resolution 4, width 4, height 4 and the origin, at the next multiple of
# eight of the body.
NANOSEC_AT, FRAME_LENGTH_AT, FRAME_AT, POSE_AT = 8, 12, 16, 20
RESOLUTION_AT, WIDTH_AT, HEIGHT_AT, ORIGIN_AT = 28, 32, 36, 44


def hostile_vectors() -> list[Vector]:
    """Return payloads every decoder must refuse, with the reason."""
    return [
        *_hostile_frames(),
        *_hostile_grids(),
        *_hostile_poses(),
        *_hostile_twists(),
        *_hostile_batteries(),
        *_hostile_scans(),
        *_hostile_tf(),
        *_hostile_others(),
    ]


def _at(payload: bytes, offset: int, new: bytes) -> bytes:
    return payload[:offset] + new + payload[offset + len(new) :]


def _hostile(name: str, schema: str, payload: bytes, reason: str, refused: str) -> Vector:
    return Vector(name, schema, payload, {"reason": reason, "refused": refused})


def _uint32(value: int) -> bytes:
    return struct.pack("<I", value)


def _float64(value: float) -> bytes:
    return struct.pack("<d", value)


def _hostile_frames() -> list[Vector]:
    schema = schemas.POSE_STAMPED
    good = oracle.to_bytes(schema, oracle.pose_stamped("map", STAMP_NS, ROBOT))
    longer = oracle.to_bytes(schema, oracle.pose_stamped("x" * 257, STAMP_NS, ROBOT))
    head, length, text = "encapsulation header", "length of header.frame_id", "header.frame_id"
    cases = [
        ("no_bytes", b"", "nothing at all", head),
        ("header_only", good[:4], "a header and no message", "header.stamp.sec"),
        ("header_cut", good[:3], "the header is cut", head),
        ("big_endian", _at(good, 1, b"\0"), "big endian", head),
        ("xcdr2", _at(good, 1, b"\7"), "another encoding (plain CDR2)", head),
        ("header_options", _at(good, 2, b"\1"), "an option nobody has defined", head),
        ("header_counts_4", _at(good, 3, b"\4"), "padding is at most 3 bytes", head),
        ("cut", good[:-1], "the last byte is missing", "pose"),
        ("trailing", good + b"junk", "bytes after the last field", "payload"),
        ("padding_not_counted", _at(good, 3, b"\2"), "counts padding there is not", "payload"),
        (
            "a_billion_nanoseconds",
            _at(good, NANOSEC_AT, _uint32(10**9)),
            "a full second in nanosec",
            "header.stamp.nanosec",
        ),
        (
            "frame_of_length_0",
            _at(good, FRAME_LENGTH_AT, _uint32(0)),
            "no room for the NUL",
            length,
        ),
        (
            "frame_of_length_max",
            _at(good, FRAME_LENGTH_AT, _uint32(2**32 - 1)),
            "a length beyond the payload",
            length,
        ),
        ("frame_too_long", longer, "257 bytes of frame", length),
        ("frame_without_nul", _at(good, FRAME_AT + 3, b"p"), "no NUL at the end", text),
        ("frame_with_nul_inside", _at(good, FRAME_AT + 1, b"\0"), "a NUL inside", text),
        ("frame_not_utf8", _at(good, FRAME_AT, b"\xff"), "no UTF-8", text),
        ("frame_surrogate", _at(good, FRAME_AT, b"\xed\xa0\x80"), "a surrogate in UTF-8", text),
    ]
    return [_hostile(name, schema, *rest) for name, *rest in cases]


def _hostile_grids() -> list[Vector]:
    schema = schemas.OCCUPANCY_GRID
    message = oracle.occupancy_grid("map", STAMP_NS, GEOMETRY, CELLS, ORIGIN)
    good = oracle.to_bytes(schema, message)
    count_at = ORIGIN_AT + 56
    cells_at = count_at + 4
    resolution = "info.resolution"
    cases = [
        (
            f"grid_resolution_{name}",
            _at(good, RESOLUTION_AT, struct.pack("<f", value)),
            why,
            resolution,
        )
        for name, value, why in (
            ("zero", 0.0, "no size"),
            ("negative", -0.05, "negative"),
            ("nan", np.nan, "not a number"),
            ("infinite", np.inf, "infinite"),
            ("denormal", 1e-42, "absurdly small"),
            ("kilometre", 1000.0, "absurdly large"),
        )
    ]
    huge = _at(_at(good, WIDTH_AT, _uint32(2**16)), HEIGHT_AT, _uint32(2**16))
    # (-1) x (-15) is 15 in 32 bits.
    wrap = _at(_at(good, WIDTH_AT, _uint32(2**32 - 1)), HEIGHT_AT, _uint32(2**32 - 15))
    empty = _at(_at(good[:cells_at], WIDTH_AT, bytes(8)), count_at, bytes(4))
    cases += [
        ("grid_width_too_large", _at(good, WIDTH_AT, _uint32(6)), "more cells than data", "data"),
        ("grid_of_4_billion_cells", huge, "a size beyond all data", "data"),
        ("grid_size_wraps", wrap, "width x height is right only in 32 bits", "data"),
        ("grid_data_longer", _at(good, count_at, _uint32(2**32 - 1)), "4 GB in 20 bytes", "data"),
        ("grid_data_shorter", _at(good, count_at, _uint32(14)), "fewer data than cells", "data"),
        ("grid_padding_not_zero", good + b"\1", "padding that is not zero", "payload"),
        ("grid_padding_not_to_4", good + bytes(2), "zeros that end at no multiple", "payload"),
        ("grid_padding_too_long", good + bytes(5), "zeros beyond the next 4 bytes", "payload"),
        (
            "grid_padding_wrong_count",
            _at(good + bytes(1), 3, b"\2"),
            "counts 2, there is 1",
            "payload",
        ),
        ("grid_empty", empty, "no cells", "data"),
        ("grid_value_101", _at(good, cells_at, b"\x65"), "101 percent", "row 0, column 0"),
        ("grid_value_minus_2", _at(good, cells_at + 7, b"\xfe"), "-2", "row 1, column 2"),
        (
            "grid_origin_nan",
            _at(good, ORIGIN_AT, _float64(np.nan)),
            "not a number",
            "info.origin.position.x",
        ),
        (
            "grid_origin_far",
            _at(good, ORIGIN_AT + 8, _float64(2.1e7)),
            "beyond 20,000 km",
            "info.origin.position.y",
        ),
        (
            "grid_origin_no_turn",
            _at(good, ORIGIN_AT + 24, bytes(32)),
            "a quaternion of zeros",
            "info.origin.orientation",
        ),
        (
            "grid_upside_down",
            _at(good, ORIGIN_AT + 24, _float64(1.0) + bytes(24)),
            "half a turn about x",
            "info.origin.orientation",
        ),
    ]
    grids = [_hostile(name, schema, *rest) for name, *rest in cases]
    schema = schemas.OCCUPANCY_GRID_UPDATE
    good = oracle.to_bytes(schema, oracle.update("map", STAMP_NS, (7, 4), CELLS))
    return [
        *grids,
        _hostile("update_height", schema, _at(good, 32, _uint32(4)), "too many rows", "data"),
        _hostile("update_value", schema, good[:-1] + b"\x80", "-128", "row 2, column 4"),
    ]


def _hostile_poses() -> list[Vector]:
    schema = schemas.POSE_STAMPED
    good = oracle.to_bytes(schema, oracle.pose_stamped("map", STAMP_NS, ROBOT))
    cases = [
        ("pose_x_nan", 0, np.nan, "not a number", "pose.position.x"),
        ("pose_y_infinite", 1, -np.inf, "infinite", "pose.position.y"),
        ("pose_z_far", 2, 1e300, "beyond 20,000 km", "pose.position.z"),
        ("pose_turn_nan", 4, np.nan, "not a number", "pose.orientation"),
        ("pose_turn_overflows", 5, 1e300, "its square is infinite", "pose.orientation"),
        ("pose_turn_too_long", 6, 1.2, "the norm is not 1", "pose.orientation"),
    ]
    return [
        _hostile(name, schema, _at(good, POSE_AT + 8 * index, _float64(value)), why, field)
        for name, index, value, why, field in cases
    ]


def _hostile_twists() -> list[Vector]:
    plain = oracle.to_bytes(schemas.TWIST, oracle.twist(FLOATS[:6]))
    stamped = oracle.twist_stamped("base", STAMP_NS, FLOATS[:6])
    payload = oracle.to_bytes(schemas.TWIST_STAMPED, stamped)
    cases = [
        ("twist_speed_nan", schemas.TWIST, 4, plain, np.nan, "not a number", "linear.x"),
        ("twist_turn_infinite", schemas.TWIST, 44, plain, np.inf, "infinite", "angular.z"),
        (
            "twist_stamped_turn_nan",
            schemas.TWIST_STAMPED,
            len(payload) - 8,
            payload,
            np.nan,
            "not a number",
            "twist.angular.z",
        ),
    ]
    return [
        *(
            _hostile(name, schema, _at(good, at, _float64(value)), why, field)
            for name, schema, at, good, value, why, field in cases
        ),
        _hostile("twist_trailing", schemas.TWIST, plain + b"junk", "bytes after it", "payload"),
    ]


def _hostile_batteries() -> list[Vector]:
    schema = schemas.BATTERY_STATE

    def state(percentage: float, power: int = 2, cells: int = 0) -> bytes:
        return oracle.to_bytes(schema, oracle.battery(percentage, power, cells=cells))

    return [
        _hostile("battery_in_percent", schema, state(85.0), "not a share", "percentage"),
        _hostile("battery_negative", schema, state(-1.0), "below empty", "percentage"),
        _hostile("battery_infinite", schema, state(np.inf), "infinite", "percentage"),
        _hostile("battery_power", schema, state(0.5, 5), "no such status", "power_supply_status"),
        _hostile(
            "battery_cells",
            schema,
            _at(state(0.5), 52, b"\xff\xff\xff\x7f"),
            "more cells than bytes",
            "cell_voltage",
        ),
        _hostile("battery_trailing", schema, state(0.5) + b"junk", "bytes after it", "payload"),
    ]


def _hostile_scans() -> list[Vector]:
    schema, angles, limits = schemas.LASER_SCAN, (-1.5, 0.5), (0.25, 8.0)

    def scan(*, count: int = 4, angles: Any = angles, limits: Any = limits) -> bytes:
        return oracle.to_bytes(schema, oracle.scan([1.0] * count, angles, limits))

    good = scan()
    # After the header come stamp 8, frame 5 and padding 3, and seven floats.
    count_at = 4 + 16 + 28
    cases = [
        ("angle_nan", scan(angles=(np.nan, 0.5)), "no first angle", "angle_min"),
        ("angle_far", scan(angles=(7.0, 0.5)), "more than a turn", "angle_min"),
        ("step_infinite", scan(angles=(0.0, np.inf)), "no step", "angle_increment"),
        ("step_zero", scan(angles=(0.0, 0.0)), "all beams in one direction", "angle_increment"),
        ("step_wide", scan(angles=(0.0, 3.0)), "more than a turn", "angle_increment"),
        ("range_min_negative", scan(limits=(-0.1, 8.0)), "below 0", "range_min"),
        ("range_min_above_max", scan(limits=(8.0, 0.25)), "no range between", "range_min"),
        ("range_max_nan", scan(limits=(0.25, np.nan)), "no longest range", "range_max"),
        ("of_no_beam", scan(count=0), "nothing measured", "length of ranges"),
        ("count", _at(good, count_at, _uint32(2**30)), "a billion beams", "length of ranges"),
        ("intensities", _at(good, len(good) - 4, _uint32(9)), "not there", "intensities"),
        ("trailing", good + b"junk", "bytes after it", "payload"),
    ]
    return [_hostile(f"scan_{name}", schema, *case) for name, *case in cases]


def _hostile_tf() -> list[Vector]:
    schema = schemas.TF_MESSAGE
    link = ("odom", "base", STAMP_NS, ROBOT)
    good = oracle.to_bytes(schema, oracle.transforms(link, link))
    longer = oracle.to_bytes(schema, oracle.transforms(("odom", "x" * 257, 0, ROBOT)))
    # Of the first of the two: child's length, its text, x, and x of the quaternion.
    child_length_at, child_at, x_at, turn_at = 28, 32, 44, 68
    tilted = _at(_at(good, turn_at, _float64(0.3)), turn_at + 24, _float64(0.7416198487))
    child, tilt = "transforms[0].child_frame_id", "rotation of"
    cases = [
        ("count", _at(good, 4, _uint32(2**31)), "2 billion transforms", "length of transforms"),
        ("one_more", _at(good, 4, _uint32(3)), "one that is not there", "length of transforms"),
        ("one_less", _at(good, 4, _uint32(1)), "one too many", "payload"),
        ("child_of_length_max", _at(good, child_length_at, b"\xff" * 4), "4 GB of name", child),
        ("child_without_nul", _at(good, child_at + 4, b"x"), "no NUL at the end", child),
        ("child_not_utf8", _at(good, child_at, b"\xff"), "no UTF-8", child),
        ("child_too_long", longer, "257 bytes of name", child),
        ("nanosec", _at(good, 12, _uint32(10**9)), "a full second in nanosec", "stamp.nanosec"),
        ("cut", good[:-1], "the last byte is missing", "transforms[1].transform"),
        ("x_nan", _at(good, x_at, _float64(np.nan)), "not a number", "translation.x"),
        ("y_far", _at(good, x_at + 8, _float64(1e300)), "beyond 20,000 km", "translation.y"),
        ("turn_nan", _at(good, turn_at, _float64(np.nan)), "not a number", "norm of rotation"),
        ("turn_infinite", _at(good, turn_at, _float64(-np.inf)), "infinite", "norm of rotation"),
        ("turn_of_zeros", _at(good, turn_at, bytes(32)), "no quaternion", "norm of rotation"),
        ("tilted", tilted, "35 degrees off the plane", tilt),
    ]
    return [_hostile(f"tf_{name}", schema, *rest) for name, *rest in cases]


def _hostile_others() -> list[Vector]:
    schema = schemas.PATH
    walk = [("map", STAMP_NS, ROBOT)] * 3
    good = oracle.to_bytes(schema, oracle.path("map", STAMP_NS, walk))
    stray = oracle.path("map", STAMP_NS, [*walk, ("odom", STAMP_NS, ROBOT)])
    stray_payload, last_nanosec = oracle.to_bytes(schema, stray), len(good) - 56 - 16 + 4
    like_it = oracle.to_bytes(
        schema, oracle.path("map", STAMP_NS, [walk[0], ("mop", STAMP_NS, ROBOT), walk[0]])
    )
    paths = [
        ("path_count", _at(good, 20, _uint32(2**31)), "2 billion poses", "length of poses"),
        ("path_one_more", _at(good, 20, _uint32(4)), "a pose that is not there", "poses"),
        ("path_one_less", _at(good, 20, _uint32(2)), "a pose too many", "payload"),
        ("path_stray_frame", stray_payload, "a pose in another frame", "poses[3].header.frame_id"),
        (
            "path_stray_frame_like_it",
            like_it,
            "a frame of the same length",
            "poses[1].header.frame_id",
        ),
        ("path_nan", good[:-8] + _float64(np.nan), "not a number", "poses[2].pose.orientation"),
        (
            "path_nanosec",
            _at(good, last_nanosec, _uint32(10**9)),
            "a full second in nanosec",
            "poses[2].header.stamp.nanosec",
        ),
    ]
    levels = [[0, 1, 2], [3, 4, 5]]
    pheromone = [
        (f"pheromone_{name}", pheromone_bytes(levels, low, high), why, "trail_min, trail_max")
        for name, low, high, why in (
            ("min_above_max", 2.0, 1.0, "the bounds are the wrong way round"),
            ("negative", -1.0, 1.0, "a negative trail"),
            ("zero", 0.0, 0.0, "levels without a trail"),
            ("infinite", 1.0, np.inf, "an infinite trail"),
            ("nan", np.nan, np.nan, "not a number"),
        )
    ]
    odometry = oracle.odometry("map", 0, "x" * 257, ROBOT, FLOATS, FLOATS[:6], FLOATS)
    return [
        *(_hostile(name, schema, *rest) for name, *rest in paths),
        *(_hostile(name, schemas.PHEROMONE_GRID, *rest) for name, *rest in pheromone),
        _hostile(
            "odometry_child_frame",
            schemas.ODOMETRY,
            oracle.to_bytes(schemas.ODOMETRY, odometry),
            "257 bytes of child frame",
            "length of child_frame_id",
        ),
    ]
