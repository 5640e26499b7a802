"""Limits count the thing itself: nothing but progress begins them anew."""

from fasaco_edge.mission.events import State
from tests.mission.test_retries import drives
from tests.mission.world import answer, patch, pose_at

SHORT = 0.48


def drive_short(drive, cells, *events):
    """Drive a cell in a second; into ``cells`` no farther than their edge, with no tool there."""
    if drive.request is not None:
        request, drive.request = drive.request, None
        drive.tell(answer(request))
    before = drive.cell
    if drive.walk:
        drive.cell = drive.walk.pop(0)
    if drive.cell in cells and before != drive.cell:
        drive.aside = SHORT * (before[1] - drive.cell[1])
    row, col = drive.cell
    short = (row - SHORT, col + drive.aside) if drive.cell in cells else drive.cell
    drive.tell(pose_at(*short), *events, after=1.0)


def test_a_flickering_cell_does_not_count_as_progress():
    drive = drives("##.##", ".....", cell=(0, 2))
    drive.command("start", {"zones": []})
    for tick in range(200):
        flickers = [patch(".#"[tick // 5 % 2], at=(0, 4))] if tick % 5 == 0 else []
        drive_short(drive, {(0, 0), (0, 4)}, *flickers)
    assert drive.mission.state is State.DONE
    assert drive.mission.reason.startswith("66 % of 0.4 m2 covered; 0.1 m2 not reached: ")
