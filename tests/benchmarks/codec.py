"""rosbags, another reader and writer of the same messages, which ours is held against.

The codecs of ``benchmarks codec``: messages of a robot's day, through ours and through rosbags.

``benchmarks codec``: bytes to values and back, beside rosbags.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fasaco_edge.bench.benchmark import Benchmark, Goal, Report, Say, peak_mb, positive
from fasaco_edge.drawing.spread import Spread, document
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.host.resources import folder
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.paths import decode_path, encode_path
from fasaco_edge.wire.messages.poses import decode_pose, encode_pose_stamped
from fasaco_edge.wire.schemas import OCCUPANCY_GRID_UPDATE, PHEROMONE_GRID
from tests.benchmarks.harness import within


class RosbagsCodec:
    """Encodes and decodes the messages of the contract by rosbags."""

    def __init__(self) -> None:
        """Learn the messages, those that ROS 2 does not have included."""
        self._store = get_typestore(Stores.ROS2_JAZZY)
        for schema in (OCCUPANCY_GRID_UPDATE, PHEROMONE_GRID):
            definition = folder("protocol") / "msg" / f"{schema.rsplit('/', 1)[1]}.msg"
            self._store.register(get_types_from_msg(definition.read_text(), schema))

    def encode(self, message: object, schema: str) -> bytes:
        """Return a message as bytes: Zenoh takes no memoryview."""
        return bytes(self._store.serialize_cdr(message, schema))

    def decode(self, payload: bytes, schema: str) -> object:
        """Return the message in ``payload``."""
        return self._store.deserialize_cdr(payload, schema)


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
MESSAGES = 4


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
            counts = [_calls_a_sample(run) for run in both]
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
    yield _Case(
        "Pose",
        schemas.POSE_STAMPED,
        partial(encode_pose_stamped, stamped),
        partial(decode_pose, schema=schemas.POSE_STAMPED),
    )
    xy, yaw = rng.normal(scale=30.0, size=(poses, 2)), rng.uniform(-3.0, 3.0, poses)
    yield _Case(
        f"path, {poses} poses",
        schemas.PATH,
        partial(encode_path, xy, yaw, "map", STAMP_NS),
        decode_path,
    )


def _calls_a_sample(run: Run) -> int:
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


DEFAULT_SIDE, DEFAULT_POSES = 1000, 20_000
MOST_SIDE, MOST_POSES = 4000, 1_000_000
# Of a long path, whose poses rosbags takes one by one.
GOAL_POSES, GOAL_PATH_RATIO = 20_000, 20.0
GOAL_RATIO = 1.0
HEADER = ("message", "", "bytes", "ours", "rosbags", "ratio", "memory", "rosbags'", "same")


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--side",
        type=within(1, MOST_SIDE),
        default=DEFAULT_SIDE,
        metavar="CELLS",
        help="edge of the grid (default: %(default)s)",
    )
    parser.add_argument(
        "--poses",
        type=within(1, MOST_POSES),
        default=DEFAULT_POSES,
        help="of the path (default: %(default)s)",
    )
    parser.add_argument(
        "--repeats", type=positive, default=9, help="of each measurement (default: %(default)s)"
    )


def _count(args: argparse.Namespace) -> int:
    count: int = MESSAGES * len(WAYS) * args.repeats
    return count


def _measure(args: argparse.Namespace, say: Say) -> Generator[CodecTiming, None, None]:
    return measure(args.side, args.poses, args.repeats, say)


def _report(args: argparse.Namespace, samples: Sequence[CodecTiming]) -> Report:
    kinds = dict.fromkeys((sample.message, sample.way) for sample in samples)
    figures = [
        _figures([sample for sample in samples if (sample.message, sample.way) == kind])
        for kind in kinds
    ]
    return Report(
        title="one call [us]",
        header=HEADER,
        rows=tuple(_row(kind) for kind in figures),
        figures={"codecs": figures},
        goals=tuple(_goals(args, figures)),
        remarks=(
            "medians, below them the range; ratio: how much faster ours is, median of the pairs; "
            "memory: most that a call takes at once, the result included [kB]; same: whether both "
            "write the same bytes",
            f"peak memory of this process {peak_mb()} MB",
        ),
    )


def _figures(samples: Sequence[CodecTiming]) -> dict[str, Any]:
    first = samples[0]
    ours = Spread.of([sample.ours_us for sample in samples])
    rosbags = Spread.of([sample.rosbags_us for sample in samples])
    # Of pairs measured together: what slows the machine down for a while slows both.
    ratio = Spread.of([sample.rosbags_us / sample.ours_us for sample in samples])
    assert ours is not None
    assert rosbags is not None
    assert ratio is not None
    return {
        "message": first.message,
        "way": first.way,
        "bytes": first.payload,
        "repeats": len(samples),
        "ours_us": document(ours),
        "rosbags_us": document(rosbags),
        "ratio": round(ratio.median, 2),
        "ours_peak": first.ours_peak,
        "rosbags_peak": first.rosbags_peak,
        "same": all(sample.same for sample in samples),
    }


def _row(kind: dict[str, Any]) -> tuple[str, ...]:
    return (
        kind["message"],
        kind["way"],
        str(kind["bytes"]),
        _microseconds(kind["ours_us"]),
        _microseconds(kind["rosbags_us"]),
        f"{kind['ratio']:.3g}",
        f"{1e-3 * kind['ours_peak']:.1f}",
        f"{1e-3 * kind['rosbags_peak']:.1f}",
        "yes" if kind["same"] else "NO",
    )


def _microseconds(spread: dict[str, float]) -> str:
    median, low, high = (spread[name] for name in ("median", "low", "high"))
    digits = 0 if median >= 100.0 else 1
    return f"{median:.{digits}f}\n{low:.{digits}f}-{high:.{digits}f}"


def _goals(args: argparse.Namespace, figures: Sequence[dict[str, Any]]) -> Iterator[Goal]:
    for kind in figures:
        long_path = kind["message"].startswith("path") and args.poses >= GOAL_POSES
        least = GOAL_PATH_RATIO if long_path else GOAL_RATIO
        what = f"{kind['way']} {kind['message']}: ratio"
        yield Goal(what, kind["ratio"], least, at_least=True)


CODEC = Benchmark(
    name="codec",
    summary="encoding and decoding of messages, beside rosbags",
    description="Encode and decode a grid, a map update, poses and a path, again and again, and "
    "let rosbags do the same straight after; it has to be installed. Ours checks every value, "
    "rosbags none. What rosbags encodes is a message that exists already; it becomes bytes, as "
    "Zenoh takes no memoryview. Reads: times are medians with their range.",
    add_options=_add_options,
    count=_count,
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks codec
  python -m tests.benchmarks codec --side 4000 --poses 100000 --json
""",
)
