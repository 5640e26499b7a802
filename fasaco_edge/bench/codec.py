"""``bench codec``: bytes to values and back, beside rosbags."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from fasaco_edge.bench.benchmark import Benchmark, Goal, Report, Say, positive
from fasaco_edge.bench.machine import machine, peak_mb
from fasaco_edge.bench.spread import Spread, document

if TYPE_CHECKING:
    from fasaco_edge.bench.codec_runs import CodecTiming

DEFAULT_SIDE, DEFAULT_POSES = 1000, 20_000
MOST_SIDE, MOST_POSES = 4000, 1_000_000
# Of a long path, whose poses rosbags takes one by one.
GOAL_POSES, GOAL_PATH_RATIO = 20_000, 20.0
GOAL_RATIO = 1.0
HEADER = ("message", "", "bytes", "ours", "rosbags", "ratio", "memory", "rosbags'", "same")


def _side(text: str) -> int:
    return _within(text, MOST_SIDE)


def _poses(text: str) -> int:
    return _within(text, MOST_POSES)


def _within(text: str, most: int) -> int:
    number = positive(text)
    if number > most:
        raise argparse.ArgumentTypeError(f"must be in 1..{most}, got {text}")
    return number


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--side",
        type=_side,
        default=DEFAULT_SIDE,
        metavar="CELLS",
        help="edge of the grid (default: %(default)s)",
    )
    parser.add_argument(
        "--poses", type=_poses, default=DEFAULT_POSES, help="of the path (default: %(default)s)"
    )
    parser.add_argument(
        "--repeats", type=positive, default=9, help="of each measurement (default: %(default)s)"
    )


def _count(args: argparse.Namespace) -> int:
    # Here, as below, so that to list the benchmarks does not need rosbags.
    from fasaco_edge.bench.codec_runs import MESSAGES, WAYS  # noqa: PLC0415

    count: int = MESSAGES * len(WAYS) * args.repeats
    return count


def _measure(args: argparse.Namespace, say: Say) -> Generator[CodecTiming, None, None]:
    from fasaco_edge.bench.codec_runs import measure  # noqa: PLC0415

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
        figures={"codecs": figures, "peak_rss_mb": peak_mb(), "machine": machine()},
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
  fasaco-edge bench codec
  fasaco-edge bench codec --side 4000 --poses 100000 --json
""",
)
