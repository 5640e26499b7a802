"""Maps taken in, few and small: the same lattice, and every way a map may come."""

import json

import pytest

from tests.benchmarks.__main__ import main
from tests.benchmarks.ingest import CASES, measure


def test_each_map_is_taken_in_right():
    heard = []
    samples = list(measure([400], 2, heard.append))
    assert heard == ["400 x 400"]
    assert [sample.case for sample in samples] == [*CASES, *CASES]
    for sample in samples:
        assert sample.same
        assert sample.cells > 0
        assert min(sample.decode_ms, sample.change_ms, sample.whole_ms) > 0
    shares = {sample.case: sample.changed for sample in samples}
    assert 0 < shares["patch"] == shares["full map"] < 0.01
    assert shares["grown map"] == pytest.approx(1 - (368 / 400) ** 2)
    assert shares["moved map"] == 1.0


def test_it_runs_as_a_command(capsys):
    words = ["ingest", "--sides", "400", "1024", "400", "--repeats", "1", "--json"]
    assert main(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert [figures["side"] for figures in document["maps"]] == [400] * len(CASES) + [1024] * len(
        CASES
    )
    assert all(figures["same"] for figures in document["maps"])
    assert len(document["goals"]) == 2
    assert all(goal["limit"] == 10.0 for goal in document["goals"])


def test_a_map_too_small_for_a_building_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["ingest", "--sides", "100"])
    assert "must be in 400..8000" in capsys.readouterr().err
