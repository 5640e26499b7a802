"""Benchmark of replans by parts, in a small building."""

import json

from tests.benchmarks.__main__ import main
from tests.benchmarks.replan import CASES


def test_replans_are_timed_by_part_and_give_the_same_lines(capsys):
    digests = []
    # The second time only the last case.
    for cases in (CASES, CASES[-1:]):
        words = ["--cells", "1000", "--replans", "2", "--cases", *cases]
        assert main(["replan", *words, "--json"]) == 0
        document = json.loads(capsys.readouterr().out)
        runs = document["replans"]
        assert [run["case"] for run in runs] == [case for case in cases for _ in range(2)]
        for run in runs:
            assert {"ingest", "reach", "repair", "rest"} <= set(run["ms"])
            assert run["total_ms"] == sum(run["ms"].values())
        digests.append([run["digest"] for run in runs])
    assert digests[0][2:] == digests[1]
