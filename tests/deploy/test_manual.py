"""What deploy/README.md tells people to type and to write is understood."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess

import pytest

from fasaco_edge.config.loading import load_config
from tests.deploy.manual import MANUAL, blocks
from tests.support.processes import PROGRAM

DEPLOY = MANUAL.parent
COMMANDS = [command for block in blocks() for command in block.commands]


def test_every_block_of_commands_is_one():
    scripts = [block.text for block in blocks() if block.kind == "sh"]
    assert len(scripts) >= 10
    for script in scripts:
        subprocess.run(["bash", "-n"], input=script, text=True, check=True)


def test_every_configuration_is_one(tmp_path):
    texts = [block.text for block in blocks() if block.kind == "yaml"]
    assert len(texts) >= 3
    for text in texts:
        (tmp_path / "config.yaml").write_text(text)
        load_config(tmp_path / "config.yaml")


@pytest.mark.parametrize("command", sorted({c for c in COMMANDS if c.startswith("fasaco-edge")}))
def test_the_program_knows_every_word(command):
    name, *words = shlex.split(command)[1:]
    told = subprocess.run([*PROGRAM, name, "--help"], capture_output=True, text=True, check=True)
    assert all(word in told.stdout for word in words if word.startswith("-"))


def test_every_file_of_ours_is_there():
    named = {word for command in COMMANDS for word in shlex.split(command)}
    for prefix in ("/opt/fasaco-edge/current/deploy/", "./"):
        files = [word.removeprefix(prefix) for word in named if word.startswith(prefix)]
        assert files
        assert [name for name in files if not (DEPLOY / name).is_file()] == []


def test_the_container_file_copies_what_is_there():
    text = (DEPLOY / "Containerfile").read_text(encoding="utf-8")
    copied = [line.split()[1:-1] for line in text.splitlines() if line.startswith("COPY ")]
    assert copied
    missing = [name for names in copied for name in names if not (DEPLOY.parent / name).exists()]
    assert missing == []
    for place in re.findall(r"=(/var/\w+/fasaco-edge)", text):
        assert f":{place}" in text, "a volume keeps it"


@pytest.mark.parametrize("script", ["install.sh", "uninstall.sh"])
def test_the_scripts_have_help_that_lists_the_manuals_options(script):
    told = subprocess.run([DEPLOY / script, "--help"], capture_output=True, text=True, check=True)
    lines = [shlex.split(command) for command in COMMANDS if script in command]
    assert lines
    for words in lines:
        assert all(word in told.stdout for word in words if word.startswith("--"))


def test_kernels_are_compiled_into_the_folder_the_service_reads():
    unit = (DEPLOY / "fasaco-edge.service").read_text()
    place = (DEPLOY / "steps/common.sh").read_text()
    assert "\nEnvironment=NUMBA_CACHE_DIR=%C/fasaco-edge/numba\n" in unit
    assert "\nKERNELS=/var/cache/fasaco-edge/numba\n" in place


def test_the_shell_scripts_are_clean():
    if shutil.which("shellcheck") is None:
        pytest.skip("shellcheck is not installed")
    scripts = [DEPLOY / "install.sh", DEPLOY / "uninstall.sh"]
    words = ["shellcheck", "--external-sources", *scripts]
    told = subprocess.run(words, cwd=DEPLOY.parent, capture_output=True, text=True, check=False)
    assert told.stdout == ""
