"""``benchmarks codec``: both codecs measured on the same messages, and judged by their ratio."""

from __future__ import annotations

import argparse
import json

import pytest

from fasaco_edge.bench.benchmark import Report
from tests.benchmarks.__main__ import main
from tests.benchmarks.codec import CODEC, CodecTiming

MESSAGES = ["grid, 50 x 50", "patch, 64 x 64", "Pose", "path, 30 poses"]


def test_both_write_the_same(capsys):
    words = ["codec", "--side", "50", "--poses", "30", "--repeats", "2", "--json"]
    assert main(words) == 0
    document = json.loads(capsys.readouterr().out)
    kinds = [(kind["message"], kind["way"]) for kind in document["codecs"]]
    assert kinds == [(message, way) for message in MESSAGES for way in ("encode", "decode")]
    for kind in document["codecs"]:
        assert kind["same"] is True
        assert kind["repeats"] == 2
        for spread in (kind["ours_us"], kind["rosbags_us"]):
            assert 0 < spread["low"] <= spread["median"] <= spread["high"]
        least = kind["rosbags_us"]["low"] / kind["ours_us"]["high"]
        most = kind["rosbags_us"]["high"] / kind["ours_us"]["low"]
        assert least - 0.01 <= kind["ratio"] <= most + 0.01
        assert min(kind["ours_peak"], kind["rosbags_peak"], kind["bytes"]) > 0
    # A path of thirty poses is none of those that have to be twenty times faster.
    assert {goal["limit"] for goal in document["goals"]} == {1.0}


def report(poses: int, *times: tuple[float, float], same: bool = True) -> Report:
    timings = [
        CodecTiming(f"path, {poses} poses", "encode", 9, ours_us, rosbags_us, 1, 2, same)
        for ours_us, rosbags_us in times or [(10.0, 150.0)]
    ]
    parser = argparse.ArgumentParser()
    CODEC.add_options(parser)
    return CODEC.report(parser.parse_args(["--poses", str(poses)]), timings)


@pytest.mark.parametrize(("poses", "met"), [(20_000, False), (19_999, True)])
def test_long_paths_have_to_be_twenty_times_faster(poses, met):
    (goal,) = report(poses).goals
    assert (goal.measured, goal.met) == (15.0, met)


def test_the_ratio_is_that_of_pairs():
    """A machine that was slow for a while, for both, in two of three pairs."""
    (figures,) = report(9, (10.0, 20.0), (90.0, 180.0), (80.0, 160.0)).figures["codecs"]
    assert figures["ratio"] == 2.0
    (figures,) = report(9, (10.0, 20.0), (90.0, 90.0), (80.0, 40.0)).figures["codecs"]
    assert figures["ratio"] == 1.0


def test_other_bytes_are_told():
    assert report(9, same=False).rows[0][-1] == "NO"
