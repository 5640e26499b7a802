"""The index of campaigns names each that can be run."""

from pathlib import Path

from tests.campaigns.__main__ import campaigns

# Parts of other campaigns, run by these; and the index.
PARTS = {"__main__", "fault_stage", "passing_mappers", "test_index"}


def test_each_campaign_is_in_the_index():
    index = campaigns()
    commands = " ".join(command for command, _, _ in index)
    runs = {
        path.stem
        for path in Path(__file__).parent.glob("*.py")
        if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
    }
    assert all(f"tests.campaigns.{name}" in commands for name in runs - PARTS)
    assert all(about.endswith(".") and takes for _, about, takes in index)
