"""``bench codec``: both codecs measured on the same messages, and judged by their ratio."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

import pytest

from fasaco_edge.bench.benchmark import Report
from fasaco_edge.bench.codec import CODEC
from fasaco_edge.bench.codec_runs import CodecTiming
from fasaco_edge.cli import main

MESSAGES = [
    "grid, 50 x 50", "patch, 64 x 64", "Pose", "PoseWithCovariance", "Odometry", "path, 30 poses",
]  # fmt: skip


def test_both_write_the_same(capsys):
    words = ["bench", "codec", "--side", "50", "--poses", "30", "--repeats", "2", "--json"]
    assert main(words) == 0
    document = json.loads(capsys.readouterr().out)
    kinds = [(kind["message"], kind["way"]) for kind in document["codecs"]]
    assert kinds == [(message, way) for message in MESSAGES for way in ("encode", "decode")]
    for kind in document["codecs"]:
        assert kind["same"] is True
        assert kind["repeats"] == 2
        for spread in (kind["ours_us"], kind["rosbags_us"]):
            assert 0 < spread["low"] <= spread["median"] <= spread["high"]
        ratio = kind["rosbags_us"]["median"] / kind["ours_us"]["median"]
        assert kind["ratio"] == pytest.approx(ratio, abs=0.01)
        assert min(kind["ours_peak"], kind["rosbags_peak"], kind["bytes"]) > 0
    # A path of thirty poses is none of those that have to be twenty times faster.
    assert {goal["limit"] for goal in document["goals"]} == {1.0}


def report(poses: int, **changes: object) -> Report:
    words = {"message": f"path, {poses} poses", "way": "encode", "payload": 9, "same": True}
    times = {"ours_us": 10.0, "rosbags_us": 150.0, "ours_peak": 1, "rosbags_peak": 2}
    timing = CodecTiming(**(words | times | changes))  # type: ignore[arg-type]
    parser = argparse.ArgumentParser()
    CODEC.add_options(parser)
    return CODEC.report(parser.parse_args(["--poses", str(poses)]), [timing])


@pytest.mark.parametrize(("poses", "met"), [(20_000, False), (19_999, True)])
def test_long_paths_have_to_be_twenty_times_faster(poses, met):
    (goal,) = report(poses).goals
    assert (goal.measured, goal.met) == (15.0, met)


def test_other_bytes_are_told():
    assert report(9, same=False).rows[0][-1] == "NO"


def test_without_rosbags_it_says_what_to_install(tmp_path: Path):
    """A folder before all others, in which rosbags is none."""
    (tmp_path / "rosbags.py").write_text("raise ImportError('no rosbags here')\n")
    checkout = Path(__file__).parents[2]
    code = (
        f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(checkout)!r}]; "
        "from fasaco_edge.cli import main; sys.exit(main(['bench', 'codec']))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 1
    assert "rosbags, which is not installed" in ended.stderr
    assert "pip install rosbags" in ended.stderr
