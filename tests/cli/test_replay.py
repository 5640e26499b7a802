"""What ``replay`` says where there is nothing to replay; the rest is in tests/daemon."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from fasaco_edge.cli import main


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "No such file or directory"),
        ("hello", "this is no recording"),
        ("RRF2 and then nothing", "holds no samples"),
    ],
)
def test_a_file_that_is_no_recording_is_named(tmp_path, capsys, content, told):
    path = tmp_path / "a.rrd"
    if content is not None:
        path.write_text(content)
    assert main(["replay", str(path)]) == 1
    err = capsys.readouterr().err
    assert f"fasaco-edge: {path}: " in err
    assert told in err
    assert "hint: " in err


def test_work_is_a_count(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["replay", "a.rrd", "--work", "-1"])
    assert "whole number from 0 on, got '-1'" in capsys.readouterr().err
