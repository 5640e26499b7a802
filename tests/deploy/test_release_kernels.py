"""Compiled kernels in our wheel: pip finds the wheel as it should be, a robot finds its kernels."""

import base64
import csv
import hashlib
import json
import platform
import zipfile
from pathlib import Path

import pytest

from fasaco_edge.kernels import release
from tests.deploy.wheels import write_wheel
from wheelhouse.closure import IncompleteError, Target, closure_of
from wheelhouse.kernels import INSIDE, check_kernels, python_for, sources_digest, with_kernels

HERE = Target(platform.machine(), ".".join(platform.python_version_tuple()[:2]))
OURS = Path(release.__file__).parents[2]


@pytest.fixture
def kernels(tmp_path):
    """Code files and their manifest, as `warmup --for-release` leaves them."""
    folder = tmp_path / "kernels"
    folder.mkdir()
    for name in ("one", "two"):
        (folder / f"{name}{release.KERNEL_SUFFIX}").write_bytes(name.encode() * 1000)
    assert release.write_manifest(folder) == 2
    return folder


@pytest.fixture
def wheel(tmp_path):
    """A wheel of ours with the kernels' sources."""
    sources = {str(file.relative_to(OURS)): file.read_bytes() for file in release.KERNEL_SOURCES}
    return write_wheel(tmp_path / "wheels", "fasaco_edge", "1.0", files=sources)


def versions() -> dict[str, str]:
    return {name: release.made_for()[name] for name in release.COMPILERS}


def test_the_wheel_is_one_for_its_target_and_lists_every_file(wheel, kernels):
    made = with_kernels(wheel, kernels, HERE)
    python = f"cp{HERE.python.replace('.', '')}"
    assert made.name == f"fasaco_edge-1.0-{python}-none-manylinux_2_17_{HERE.machine}.whl"
    assert list(made.parent.iterdir()) == [made]
    with zipfile.ZipFile(made) as opened:
        files = {name: opened.read(name) for name in opened.namelist()}
    assert f"{INSIDE}/one.kernel" in files
    assert f"{INSIDE}/{release.MANIFEST}" in files
    tag = made.name.removeprefix("fasaco_edge-1.0-").removesuffix(".whl")
    assert f"Tag: {tag}\n".encode() in files["fasaco_edge-1.0.dist-info/WHEEL"]
    record = "fasaco_edge-1.0.dist-info/RECORD"
    rows = {
        path: (digest, size)
        for path, digest, size in csv.reader(files[record].decode().split("\n")[:-1])
    }
    assert set(rows) == set(files)
    for path, content in files.items():
        if path == record:
            assert rows[path] == ("", "")
            continue
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        assert rows[path] == (f"sha256={digest}", str(len(content)))
    assert closure_of(made.parent, HERE, ()).version == "1.0"


def test_the_same_kernels_make_the_same_wheel(wheel, kernels, tmp_path):
    plain = wheel.read_bytes()
    first = with_kernels(wheel, kernels, HERE).read_bytes()
    wheel.write_bytes(plain)
    assert with_kernels(wheel, kernels, HERE).read_bytes() == first


def test_the_source_hash_equals_that_of_the_installed_package(wheel):
    assert sources_digest(wheel) == release.sources_digest()


def test_kernels_that_a_robot_would_not_use_are_refused(wheel, kernels):
    check_kernels(kernels, wheel, HERE, versions())
    for what in ("machine", "python", "sources", "numba", "llvmlite"):
        document = json.loads((kernels / release.MANIFEST).read_text())
        document["made_for"][what] = "another"
        (kernels / release.MANIFEST).write_text(json.dumps(document))
        with pytest.raises(IncompleteError, match=f"are for {what} another, not "):
            check_kernels(kernels, wheel, HERE, versions())
        release.write_manifest(kernels)


@pytest.mark.parametrize("text", [None, "", "[]", "{}", '{"made_for": []}'])
def test_a_folder_without_a_manifest_is_refused_by_name(wheel, kernels, text):
    (kernels / release.MANIFEST).unlink()
    if text is not None:
        (kernels / release.MANIFEST).write_text(text)
    with pytest.raises(
        IncompleteError, match="kernels is no folder of `fasaco-edge warmup --for-r"
    ):
        check_kernels(kernels, wheel, HERE, versions())


def test_kernels_are_compiled_only_for_what_there_is_a_python_of():
    assert python_for(HERE) is not None
    assert python_for(Target("another", HERE.python)) is None
    assert python_for(Target(HERE.machine, "3.99")) is None
