"""What a release folder holds: all that is needed for the robot, and no viewer."""

import hashlib
import zipfile

import pytest

from tests.deploy.releases import bundled_pip
from tests.deploy.wheels import write_wheel
from wheelhouse.closure import IncompleteError, Target, closure_of
from wheelhouse.release import fill_release
from wheelhouse.viewer import VIEWER, without_viewer

PI = Target("aarch64", "3.13")
OURS = ("kernels>=2", "recorder>=1; extra == 'record'")


def test_each_needs_what_it_needs_on_the_robot_and_not_here(tmp_path):
    write_wheel(
        tmp_path,
        "fasaco_edge",
        "1.0",
        needs=(
            "for_pi; platform_machine == 'aarch64'",
            "for_pc; platform_machine == 'x86_64'",
            "old; python_version < '3.12'",
            "new; python_version >= '3.12'",
        ),
    )
    write_wheel(tmp_path, "for_pi", "1.0", needs=("deeper",))
    for name in ("deeper", "new"):
        write_wheel(tmp_path, name, "1.0")
    assert set(closure_of(tmp_path, PI, ()).files) == {"fasaco-edge", "for-pi", "deeper", "new"}


def test_a_missing_wheel_is_named_with_its_dependant(tmp_path):
    write_wheel(tmp_path, "fasaco_edge", "1.0", needs=OURS)
    write_wheel(tmp_path, "kernels", "2.1", needs=("arrays>=1",))
    with pytest.raises(IncompleteError, match="kernels needs arrays>=1: no wheel"):
        closure_of(tmp_path, PI, ())


def test_a_version_that_does_not_do_is_named(tmp_path):
    write_wheel(tmp_path, "fasaco_edge", "1.0", needs=OURS)
    write_wheel(tmp_path, "kernels", "1.9")
    with pytest.raises(IncompleteError, match=r"fasaco-edge needs kernels>=2, there is kernels-1"):
        closure_of(tmp_path, PI, ())


def test_two_versions_of_one_are_not_guessed_between(tmp_path):
    write_wheel(tmp_path, "fasaco_edge", "1.0")
    write_wheel(tmp_path, "fasaco_edge", "1.1")
    with pytest.raises(IncompleteError, match="two wheels of fasaco-edge"):
        closure_of(tmp_path, PI, ())


def test_a_release_folder_lists_every_wheel_with_its_hash(tmp_path):
    wheels, release = tmp_path / "found", tmp_path / "release"
    write_wheel(wheels, "fasaco_edge", "1.0", needs=OURS)
    write_wheel(wheels, "kernels", "2.1")
    recorder = write_wheel(wheels, "recorder", "1.0")
    write_wheel(wheels, "left_over", "1.0")
    fill_release(release, wheels, bundled_pip(), PI, recording=True)
    files = {file.name for file in (release / "wheels").iterdir()}
    assert "left_over-1.0-py3-none-any.whl" not in files
    listed = (release / "wheels/requirements-record.txt").read_text()
    digest = hashlib.sha256(recorder.read_bytes()).hexdigest()
    assert f"\nrecorder==1.0 --hash=sha256:{digest}\n" in listed
    assert "recorder" not in (release / "wheels/requirements.txt").read_text()
    assert "VERSION=1.0\nARCH=aarch64\nPYTHON=3.13\n" in (release / "wheels/RELEASE").read_text()
    assert (release / "fasaco-edge.yaml").is_file()


def test_without_recording_there_is_no_recorder(tmp_path):
    wheels, release = tmp_path / "found", tmp_path / "release"
    write_wheel(wheels, "fasaco_edge", "1.0", needs=OURS)
    write_wheel(wheels, "kernels", "2.1")
    fill_release(release, wheels, bundled_pip(), PI, recording=False)
    assert not (release / "wheels/requirements-record.txt").exists()


def test_the_viewer_goes_and_the_wheel_stays_one(tmp_path):
    files = {VIEWER: b"\x7fELF", "rerun_cli/__main__.py": b"", "rerun/__init__.py": b"x = 1\n"}
    wheel = write_wheel(tmp_path, "rerun_sdk", "0.41.0", files=files, commands=["rerun=r:main"])
    without_viewer(wheel)
    with zipfile.ZipFile(wheel) as slim:
        names = set(slim.namelist())
        record = slim.read("rerun_sdk-0.41.0.dist-info/RECORD").decode().splitlines()
        assert slim.read("rerun/__init__.py") == b"x = 1\n"
    assert VIEWER not in names
    assert "rerun_cli/__main__.py" in names
    assert {line.split(",")[0] for line in record} == names
