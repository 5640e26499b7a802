"""The codecs of ``bench codec``: messages of a robot's day, through ours and through rosbags."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.bench.codec_rosbags import RosbagsCodec
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire import schemas
from fasaco_edge.wire.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from fasaco_edge.wire.paths import decode_path, encode_path
from fasaco_edge.wire.poses import (
    POSE_SCHEMAS,
    decode_pose,
    encode_odometry,
    encode_pose_stamped,
    encode_pose_with_covariance_stamped,
)

STAMP_NS = 1_700_000_000_123_456_789
PATCH_SIDE = 64
# One measurement goes on for so long: the clock's ticks, and those of the system, are far shorter.
LEAST_S = 0.02

Run = Callable[[], object]


@dataclass(frozen=True, slots=True)
class CodecTiming:
    """One way of one message, measured with both codecs, one straight after the other.

    Attributes:
        message: what was encoded or decoded.
        way: "encode" or "decode".
        payload: its size [bytes].
        ours_us, rosbags_us: time of one call [us].
        ours_peak, rosbags_peak: most memory that a call takes at once [bytes].
        same: whether both encode to the same bytes.
    """

    message: str
    way: str
    payload: int
    ours_us: float
    rosbags_us: float
    ours_peak: int
    rosbags_peak: int
    same: bool


@dataclass(frozen=True, slots=True)
class _Case:
    message: str
    schema: str
    encode: Callable[[], bytes]
    decode: Callable[[bytes], object]


WAYS = ("encode", "decode")
MESSAGES = 3 + len(POSE_SCHEMAS)


def measure(side: int, poses: int, repeats: int, say: Say) -> Generator[CodecTiming, None, None]:
    """Yield ``repeats`` measurements of each message, both ways."""
    theirs = RosbagsCodec()
    for case in _cases(side, poses):
        payload = case.encode()
        message = theirs.decode(payload, case.schema)
        same = theirs.encode(message, case.schema) == payload
        runs: dict[str, tuple[Run, Run]] = {
            "encode": (case.encode, partial(theirs.encode, message, case.schema)),
            "decode": (partial(case.decode, payload), partial(theirs.decode, payload, case.schema)),
        }
        for way, both in runs.items():
            say(f"{way} {case.message}")
            peaks = [_peak(run) for run in both]
            counts = [_count(run) for run in both]
            for _ in range(repeats):
                times = [_time_us(run, count) for run, count in zip(both, counts, strict=True)]
                yield CodecTiming(
                    message=case.message,
                    way=way,
                    payload=len(payload),
                    ours_us=times[0],
                    rosbags_us=times[1],
                    ours_peak=peaks[0],
                    rosbags_peak=peaks[1],
                    same=same,
                )


def _cases(side: int, poses: int) -> Iterator[_Case]:
    rng = np.random.default_rng(0)
    cells = rng.integers(-1, 101, (side, side)).astype(np.int8)
    grid = OccupancyGrid(
        GridGeometry(side, side, 0.05, Pose2D(-1.0, 2.0, 0.3)), cells, "map", STAMP_NS
    )
    yield _Case(
        f"grid, {side} x {side}",
        schemas.OCCUPANCY_GRID,
        partial(encode_occupancy_grid, grid),
        decode_occupancy_grid,
    )
    corner = Window(10, 20, 10 + PATCH_SIDE, 20 + PATCH_SIDE)
    few = rng.integers(-1, 101, (PATCH_SIDE, PATCH_SIDE)).astype(np.int8)
    yield _Case(
        f"patch, {PATCH_SIDE} x {PATCH_SIDE}",
        schemas.OCCUPANCY_GRID_UPDATE,
        partial(encode_map_update, MapPatch(corner, few, "map", STAMP_NS)),
        decode_map_update,
    )
    stamped = StampedPose(Pose2D(1.25, -3.5, 2.5), "map", STAMP_NS)
    encoders: dict[str, Callable[[StampedPose], bytes]] = {
        schemas.POSE_STAMPED: encode_pose_stamped,
        schemas.POSE_WITH_COVARIANCE_STAMPED: encode_pose_with_covariance_stamped,
        schemas.ODOMETRY: encode_odometry,
    }
    for schema in POSE_SCHEMAS:
        yield _Case(
            schema.rsplit("/", 1)[1].removesuffix("Stamped"),
            schema,
            partial(encoders[schema], stamped),
            partial(decode_pose, schema=schema),
        )
    xy, yaw = rng.normal(scale=30.0, size=(poses, 2)), rng.uniform(-3.0, 3.0, poses)
    yield _Case(
        f"path, {poses} poses",
        schemas.PATH,
        partial(encode_path, xy, yaw, "map", STAMP_NS),
        decode_path,
    )


def _count(run: Run) -> int:
    """Return how many calls take ``LEAST_S``."""
    count = 1
    while (took_s := 1e-6 * count * _time_us(run, count)) < LEAST_S:
        count = max(2 * count, int(0.7 * count * LEAST_S / max(took_s, 1e-6)))
    return count


def _time_us(run: Run, count: int) -> float:
    started = time.perf_counter()
    for _ in range(count):
        run()
    return 1e6 * (time.perf_counter() - started) / count


def _peak(run: Run) -> int:
    run()
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        run()
        return int(tracemalloc.get_traced_memory()[1] - before)
    finally:
        tracemalloc.stop()
