"""Files that the guides for developers name: there they are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("guide", ["CONTRIBUTING.md", "fasaco_edge/README.md"])
def test_each_file_that_a_guide_names_is_there(guide):
    named = re.findall(r"`([\w/-]+\.(?:py|md|yaml))`", (ROOT / guide).read_text(encoding="utf-8"))
    assert len(named) > 20
    folders = ROOT, ROOT / "fasaco_edge"
    assert [name for name in named if not any((at / name).is_file() for at in folders)] == []
