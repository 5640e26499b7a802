"""A service's kernels: whatever has become of the cache, the start gets ready without help."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from fasaco_edge.kernels.cache import cache_folder, missing_from
from tests.daemon.test_service import Manager, service
from tests.kernels.harm import HARMS, kernel_files, mark_of, other_pickle
from tests.support.outsider import Outsider
from tests.support.processes import ENVIRONMENT, PROGRAM, free_endpoint
from tests.support.rooms import map_bytes, pillared_room, pose_bytes


@pytest.fixture
def warmed(tmp_path):
    """A cache of its own with all kernels in it."""
    ours = cache_folder()
    if missing_from(ours):
        subprocess.run([*PROGRAM, "warmup"], check=True, capture_output=True, env=ENVIRONMENT)
    shutil.copytree(ours, tmp_path / "cache" / ours.name)
    (tmp_path / "cache").chmod(0o700)
    return tmp_path / "cache"


def env_of(cache: Path) -> dict[str, str]:
    return {"NUMBA_CACHE_DIR": str(cache)}


def test_a_harmed_cache_is_mended_before_the_service_is_ready(tmp_path, warmed):
    *files, note = kernel_files(warmed)
    # Small ones, soon compiled: what is done is the same for each.
    small = sorted(files, key=lambda file: file.stat().st_size)[: len(HARMS)]
    for file, harm in zip(small, HARMS.values(), strict=True):
        harm(file)
    other_pickle(note)
    with service(tmp_path, env=env_of(warmed)) as (running, _):
        assert "compiling the kernels, for a minute or more: the list of them is damaged" in (
            running.log_text()
        )
        assert missing_from(note.parent) == ""
        assert not mark_of(note).exists()


def test_a_cache_that_cannot_be_trusted_is_left_alone_and_the_first_path_comes(tmp_path, warmed):
    (folder,) = warmed.iterdir()
    folder.chmod(0o777)
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    temporary.chmod(0o1777)
    mine = temporary / f"fasaco-edge-{os.geteuid()}-{folder.name}"
    shutil.copytree(folder, mine)  # compiled by a start before
    mine.chmod(0o700)
    env = env_of(warmed) | {"TMPDIR": str(temporary)}
    with service(tmp_path, env=env) as (running, _), Outsider(running.endpoint) as outsider:
        path = outsider.listen("path")
        outsider.put("map", map_bytes(pillared_room()))
        outsider.put("pose", pose_bytes(1.0, 1.0))
        path.wait(lambda heard: len(heard.payload) > 100)
        said = f"{folder} may be written by everybody: compiled kernels are kept in {mine}"
        assert running.log_text().count(said) == 1


def test_a_compiler_that_is_killed_is_an_error_with_its_reason(tmp_path):
    manager = Manager(tmp_path)
    env = env_of(tmp_path / "cache") | {"NOTIFY_SOCKET": manager.address}
    command = [*PROGRAM, "run", "--state", str(tmp_path / "state"), "--config"]
    config = tmp_path / "daemon.yaml"
    config.write_text(f"bus: {{listen: [{free_endpoint()}]}}\n")
    process = subprocess.Popen(
        [*command, str(config)], stderr=subprocess.PIPE, text=True, env=ENVIRONMENT | env
    )
    try:
        manager.wait("STATUS=compiling kernels: ", 60.0)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
        os.kill(int(children.split()[0]), signal.SIGKILL)
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
        manager.close()
    assert process.returncode == 1
    assert "the compiler was killed by SIGKILL, probably out of memory" in said
    assert "Traceback" not in said
