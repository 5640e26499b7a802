"""What the pages for robots tell people to type and to write is understood."""

import re
import shlex
import subprocess
from textwrap import dedent

import pytest

from fasaco_edge.config.loading import load_config
from tests.deploy.manual import MANUAL
from tests.support.processes import PROGRAM

PAGES = ("turtlebot.md",)
BLOCK = re.compile(r"^( *)```(\w+)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)


def blocks(page, kind):
    text = (MANUAL.parent / page).read_text(encoding="utf-8")
    return [dedent(code) for _, found, code in BLOCK.findall(text) if found == kind]


@pytest.mark.parametrize("page", PAGES)
def test_configurations_are_some(page, tmp_path):
    texts = blocks(page, "yaml")
    assert texts
    for text in texts:
        (tmp_path / "robot.yaml").write_text(text)
        load_config(tmp_path / "robot.yaml")


@pytest.mark.parametrize("page", PAGES)
def test_the_program_knows_every_word(page):
    scripts = blocks(page, "sh")
    lines = "".join(scripts).replace("\\\n", " ").splitlines()
    commands = {line.partition("#")[0].strip() for line in lines if line.startswith("fasaco-edge")}
    assert len(commands) >= 6
    for command in sorted(commands):
        name, *words = shlex.split(command)[1:]
        about = [name, words[0], "--help"] if name == "mission" else [name, "--help"]
        told = subprocess.run([*PROGRAM, *about], capture_output=True, text=True, check=True)
        assert all(word in told.stdout for word in words if word.startswith("-")), command
    for script in scripts:
        subprocess.run(["bash", "-n"], input=script, text=True, check=True)
