"""What users get wrong: told on standard error, with a way out, and never by a traceback."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

from fasaco_edge.cli import main
from fasaco_edge.host.processes import cpu_seconds
from tests.support.disks import disk_fixture
from tests.support.forked import run_forked
from tests.support.processes import ENVIRONMENT, PROGRAM, fasaco_edge, free_endpoint

full_disk = disk_fixture("64k")
NOBODY = "tcp/127.0.0.1:1"
MAP = "{image: map.png, resolution: 0.05, origin: [0, 0, 0], negate: 0}"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("good.npy", np.ones((6, 6), bool))
    blocked = np.ones((6, 6), bool)
    blocked[2, 2] = False
    np.save("blocked.npy", blocked)
    halves = np.ones((6, 6), bool)
    halves[3] = False
    np.save("halves.npy", halves)
    np.save("walls.npy", np.zeros((6, 6), bool))
    np.save("empty.npy", np.zeros((0, 6), bool))
    np.save("numbers.npy", np.ones((6, 6)))
    (tmp_path / "text.yaml").write_text("image: nowhere.pgm\n")
    (tmp_path / "text.npy").write_text("no grid")
    (tmp_path / "order.yaml").write_text("zones: [{passes: 2}]")
    (tmp_path / "order.json").write_text("{")
    (tmp_path / "mine.py").write_text("def f(problem): pass")
    Image.new("L", (60, 60), 255).save("map.png")
    (tmp_path / "map.yaml").write_text(MAP)
    (tmp_path / "link.png").symlink_to("map.png")
    (tmp_path / "around").symlink_to("around")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("plan nowhere.yaml", 1, "no map 'nowhere.yaml'"),
        ("plan .", 1, "'.' is a folder\n  hint: give one of its maps: map.yaml, order.yaml"),
        ("plan flatt", 1, "hint: did you mean flat?"),
        ("plan ./maps.yaml", 1, "hint: did you mean map.yaml?"),
        ("plan map.yml", 1, "hint: did you mean map.yaml?"),
        ("plan text.yaml", 1, "text.yaml"),
        ("plan numbers.npy", 1, "expected a bool array of two dimensions, got float64"),
        ("plan empty.npy", 1, "got 6 x 0"),
        ("plan walls.npy", 1, "no cell of the map is coverable"),
        ("plan blocked.npy --start 2,2", 1, "start cell (2, 2) is blocked"),
        ("plan good.npy --start 6,0", 1, "start cell (6, 0) lies outside rows 0..5"),
        ("plan good.npy --start-xy 99,0", 1, "lies outside"),
        ("plan blocked.npy --end 2,2", 1, "end cell (2, 2) is blocked"),
        ("plan halves.npy --end 5,5", 1, "no walk leads from start cell (0, 0) to end cell (5, 5)"),
        ("plan good.npy --speed-m-s 0", 78, "--speed-m-s: expected a number above 0, got 0.0"),
        ("plan good.npy --cell 1e-5", 78, "cell_m / speed_m_s: must be in [0.001, 3600] s"),
        ("plan good.npy --budget 0", 78, "budget must be finite and above 0 s, got 0.0"),
        ("plan office --cell 0.0001", 1, "exceeds 4000000 cells"),
        ("plan office --cell 0", 78, "--cell: expected a number above 0, got 0.0"),
        ("plan good.npy --ants 0", 78, "ants: must be in 8..1000000"),
        ("plan good.npy --ants 7", 78, "one for each cohort at least, got 7"),
        ("plan good.npy --velocities 8:x", 78, "velocities: must look like 8:1, 1:8, 4 or 8,4,1"),
        ("plan good.npy --seed -1", 78, "seed: must be in 0..2^63 - 1, got -1"),
        ("plan good.npy --png no/walk.png", 78, "cannot write no/walk.png: there is no folder no"),
        ("plan good.npy --png .", 78, "cannot write .: that is a folder"),
        ("plan good.npy --path-out good.npy", 78, "cannot write good.npy: it is an input"),
        ("plan good.npy --png w --path-out ./w", 78, "cannot write w: another option writes it"),
        ("plan map.yaml --png link.png", 78, "cannot write link.png: it is an input"),
        ("plan good.npy --planner mine.py:f --png mine.py", 78, "cannot write mine.py: it is an"),
        ("simulate map.yaml --trail-out map.png", 78, "cannot write map.png: it is an input"),
        ("review a.rrd --png a.rrd", 78, "cannot write a.rrd: it is an input"),
        ("review a.rrd --against b.rrd --png b.rrd", 78, "cannot write b.rrd: it is an input"),
        (
            "mission start --order o --zone a --passes 2",
            1,
            "got --zone, --passes",
        ),
        ("plan good.npy --png around", 78, "cannot write around: Too many levels of symbolic"),
        (f"plan good.npy --png {'w' * 300}", 78, "File name too long"),
        ("plan good.npy --xy-out l.csv", 78, "good.npy is a coverage grid (.npy), which lies in"),
        (f"simulate nowhere --connect {NOBODY}", 1, "no map 'nowhere'"),
        (
            f"simulate office --speed 0 --connect {NOBODY}",
            78,
            "--speed: expected a number of at least 0.01",
        ),
        ("simulate office --robot-radius 20", 78, "--robot-radius: expected a number of at most"),
        ("simulate office --battery-min -1", 78, "--battery-min must be at least 0, got -1"),
        ("rooms set 1", 78, "nothing to set: --passes, --priority, --skip or --no-skip"),
        ("simulate office --map-hz 50", 78, "--map-hz must be 1 to 5, got 50"),
        ("simulate office --range 0", 78, "--range must be above 0 m, got 0"),
        (
            f"simulate office --start-xy 999,9 --connect {NOBODY}",
            1,
            "(999, 9) m is outside the map, which reaches from",
        ),
        (f"simulate office --robot a/b --connect {NOBODY}", 78, "got 'a/b'"),
        ("simulate office --connect office", 78, "'office': no protocol before the address"),
        (f"record --out . --connect {NOBODY}", 1, f"cannot connect to {NOBODY}\n"),
        (f"record --out . --base /x --connect {NOBODY}", 78, "base: must be chunks"),
        (f"record --out . --quota-mb -5 --connect {NOBODY}", 78, "--quota-mb: expected a whole"),
        (
            f"record --out . --quota-mb 100 --connect {NOBODY}",
            78,
            "--quota-mb: must be 0 or at least twice recording.part_mb, 128",
        ),
        (
            'record --out . --fleet hall --ros2 {"kind":"bridge"}',
            78,
            "--ros2: a fleet's recording has only native keys",
        ),
        ("demo --map nowhere --out o", 1, "no map 'nowhere'"),
        ("follow --speed 0", 78, "--speed must be above 0 and at most 100, got 0"),
        ("demo --speed 0 --out o", 78, "--speed: expected a number of at least 0.01"),
        ("demo --cell 30 --out o", 78, "--cell: expected a number of at most 10, got 30.0"),
        ("demo --tool-width=30 --out o", 78, "--tool-width: expected a number of at most 10"),
        ("demo --seed -1 --out o", 78, "--seed: expected a whole number of at least 0, got -1"),
        ("demo --out good.npy", 78, "cannot write good.npy: good.npy is not a folder"),
        ("plan office --passes cross", 78, "--passes[0]: cross goes after a pass with lanes"),
        ("plan office --passes auto@2", 78, "at 2 m/s is faster than the robot, 0.25 m/s"),
        ("plan office --passes auto --planner fasaco", 78, "only colony-search has passes"),
        ("plan office --passes auto --pheromone-png p.png", 78, "has a trail of its own"),
        ("plan office --passes 30deg --line cells", 78, "the centres of cells lie along the axes"),
        ("plan office --passes auto --turn-radius 0.3", 78, "a robot that turns on the spot"),
        ("run --config nowhere.yaml", 78, "nowhere.yaml: No such file or directory"),
        ("follow --config nowhere.yaml", 78, "nowhere.yaml: No such file or directory"),
        ("follow --robot a/b", 78, "must be chunks of letters"),
        ("mission start --order missing.yaml", 1, "missing.yaml: No such file or directory"),
        ("mission start --order order.yaml", 1, "order.yaml, line 1: zones[0].name: missing"),
        ("mission start --order order.json", 1, "order.json: not plain JSON"),
        ("mission start --order order.yaml --passes 2", 1, "--order must be the only option for"),
        ("mission start --passes 0", 1, "--passes: expected a whole number of at least 1, got 0"),
        ("mission start --until-min -3", 1, "--until-min: expected a number of at least 0"),
        ("rooms set 1 --priority 101", 1, "--priority: expected a whole number of at most 100"),
        ("mission start --zone a:0,0;1,1;1,0;0,1", 1, "[0].polygon: crosses or touches itself"),
        ("mission start --zone a:0,0;1,0;nan,1", 1, "zones[0].polygon[2]: must be finite"),
        (f"mission status --connect {NOBODY}", 1, f"cannot connect to {NOBODY}\n"),
        ("mission keep-out add --name a 0,0;1,1;1,0;0,1", 1, "polygon: crosses or touches itself"),
    ],
)
def test_a_mistake_gives_an_error_with_a_hint(folder, capsys, words, code, said):
    assert main(words.split()) == code
    told = capsys.readouterr()
    assert told.out == ""
    assert said in told.err
    assert "\n  hint: " in told.err
    assert "Traceback" not in told.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "a command is missing; there are demo, plan, init"),
        ("mission", "fasaco-edge mission: a command is missing; there are start, "),
        ("rooms --json", "fasaco-edge rooms: a command is missing; there are list, "),
        ("--verison", "unrecognized arguments: --verison; did you mean --version?"),
        ("plan --planer zigzag", "unrecognized arguments: --planer; did you mean --planner?"),
        ("dance", "invalid choice: 'dance'; there are demo, plan, init"),
        ("reviw a.rrd", "did you mean review?"),
        ("bench planer", "did you mean planners?"),
        ("mission strat", "did you mean start?"),
        ("run map.yaml", "unrecognized arguments: map.yaml; did you mean --config map.yaml?"),
        ("mission --config map.yaml status", "options such as --config come after the command"),
        ("mission --json status", "arguments: --json; options such as --json come after"),
        ("--config=map.yaml run", "options such as --config come after the command"),
        ("mission -v strat", "invalid choice: 'strat'; did you mean start?"),
        ("mission start zones.yaml", "zones.yaml; did you mean --order zones.yaml?"),
        ("run --confg=map.yaml", "arguments: --confg=map.yaml; did you mean --config?"),
        ("plan", "the following arguments are required: MAP"),
        ("plan office --start here", "argument --start: must be row,column, got 'here'"),
        ("plan office --start-xy 1", "argument --start-xy: must be x,y in metres, got '1'"),
        ("rooms split 1 0,0 1;2", "argument X,Y: must be x,y in metres, got '1;2'"),
        ("plan office --start-xy 1,1e300", "must be within 2e+07 m of 0, got 1,1e300"),
        ("plan office --start 1,1 --start-xy 1,1", "not allowed with argument --start"),
        ("plan office --end there", "--end: must be anywhere, home or row,column, got 'there'"),
        ("plan office --cell wide", "argument --cell/--tool-width: must be a number of metres"),
        ("plan office --cell 0,3", "must be a number of metres, got '0,3'; did you mean 0.3?"),
        ("simulate flat --range 3m", "argument --range: must be a number of metres, got '3m'"),
        ("mission start --until-min 1h", "must be a number of minutes, got '1h'"),
        ("bench daemon --maps flat", "argument --maps: must be a whole number, got 'flat'"),
        ("demo --robots 20", "invalid choice: 20; there are 1, 2, 3, 4, 5, 6, 7, 8"),
        ("plan office --ants 1,000", "must be a whole number, got '1,000'\n"),
        ("ask status --timeout 2,5", "got '2,5'; did you mean 2.5?"),
        ("plan office --planner colony-serch", "'colony-serch'; did you mean colony-search?"),
        ("review a.rrd --pint 1,2", "unrecognized arguments: --pint 1,2; did you mean --point?"),
        ("mission start --pases 2", "did you mean --passes?"),
        ("plan office --planner best", "argument --planner: must be colony-search, fasaco, aco"),
        ("plan office --planner a-lab:Deep", "FILE.py:NAME or MODULE:NAME, got 'a-lab:Deep'"),
        ("record", "the following arguments are required: --out"),
        ("maps --log-level loud", "argument --log-level: invalid choice: 'loud'"),
        ("mission start --zone 0,0;1,0;1,1", "must be NAME or NAME:x,y;x,y;..., got"),
        ("mission start --zone a:0,0;1,0", "must be x,y;x,y;x,y;... in metres, got '0,0;1,0'"),
        ("mission start --keep-out -1,0;1;1,1", "must be x,y;x,y;x,y;... in metres, got"),
        ("mission status --timeout 0", "must be in (0, 3600] s, got '0'"),
        ("mission pause --passes 2", "unrecognized arguments"),
        ("mission keep-out", "a command is missing; there are add, remove, list"),
        ("mission keep-out add 1,1;2,1;2,2", "the following arguments are required: --name"),
        ("mission keep-out add --name a -1,1 2,1", "must be x,y;x,y;x,y;... in metres, got '-1,1"),
        ("mission keep-out remove", "the following arguments are required: NAME"),
        ("follow --pose-age nan", "must be in (0.05, 10] s"),
        ("replay a.rrd --work -1", "whole number from 0 on, got '-1'"),
        ("plan office --passes edge,corner", "got 'corner'"),
        ("plan office --align=wall", "must be walls, axes or an angle"),
        ("plan office --align=nan", "must be walls, axes or an angle"),
        ("plan office --align=361", "must be walls, axes or an angle"),
    ],
)
def test_an_unknown_word_is_named(folder, capsys, words, said):
    with pytest.raises(SystemExit, match="2"):
        main(words.split())
    told = capsys.readouterr()
    assert told.out == ""
    assert said in told.err
    # The cause first, and no usage of many lines before it.
    cause, see = told.err.splitlines()
    assert cause.startswith("fasaco-edge")
    assert re.fullmatch("see: fasaco-edge.* --help", see)


@pytest.mark.parametrize(
    "words",
    [
        ("review", "{}.rrd"),
        ("replay", "{}.rrd"),
        ("plan", "{}.npy"),
        ("plan", "{}.png", "--resolution", "0.05"),
        ("plan", "{}.yaml"),
        ("plan", "good.npy", "--planner", "{}.py:walk"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
@pytest.mark.parametrize("make", [os.mkfifo, lambda name: os.symlink("/dev/zero", name)])
def test_a_pipe_or_a_device_does_not_block_a_command(folder, words, make):
    """To open a pipe waits for whoever writes to it; a device never ends."""
    pytest.importorskip("pyarrow")
    for ending in ("rrd", "npy", "png", "yaml", "py"):
        make(f"it.{ending}")
    command = (*PROGRAM[1:], *(word.format("it") for word in words))
    code, _, err = run_forked(command, ENVIRONMENT, 120.0)
    assert code != 0
    assert "it." in err
    assert "Traceback" not in err


def test_no_file_reuses_the_descriptor_of_a_closed_stream(folder):
    code = """
import os, sys
from fasaco_edge.cli.console.streams import open_missing_streams
open_missing_streams()
print("said"), print("said", file=sys.stderr), sys.stdout.flush(), sys.stdin.read()
sys.exit(os.open("good.npy", os.O_RDONLY))
"""
    for closed in ("<&-", ">&-", "2>&-", "<&- >&- 2>&-"):
        words = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-c", code]
        ended = subprocess.run(
            words, check=False, stdin=subprocess.DEVNULL, capture_output=True, env=ENVIRONMENT
        )
        assert ended.returncode > 2, ended


def test_a_full_disk_is_named(capsys, folder):
    assert main(["plan", "good.npy", "--ants", "8", "--path-out", "/dev/full"]) == 1
    assert "cannot write /dev/full: No space left on device" in capsys.readouterr().err


def test_a_closed_pipe_is_no_error(folder):
    """As in ``fasaco-edge plan ... --json | head -c 1``."""
    command = [*PROGRAM, "plan", "good.npy", "--ants", "8", "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as process:
        process.stdout.close()
        said = process.stderr.read()
        process.wait(300)
    assert "Traceback" not in said
    assert "Exception ignored" not in said


def test_ctrl_c_ends_a_plan_with_the_best_walk_so_far(folder):
    pillars = np.ones((300, 300), bool)
    pillars[5::10, 5::10] = False
    np.save("large.npy", pillars)
    # Turns at a price: no walk is proven to be the best, so only Ctrl-C ends the search.
    command = [*PROGRAM, "plan", "large.npy", "--budget", "60", "--turn-s", "2", "--json"]
    command += ["--path-out", "walk.csv"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as process:
        # Not before it is at work: Python's own start cannot be interrupted in order.
        while cpu_seconds(process.pid) < 4.0:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        printed, said = process.communicate(timeout=120)
    assert "Traceback" not in said
    assert process.returncode == 130
    figures = json.loads(printed)
    assert figures["ended_by"] == "Ctrl-C"
    walk = np.loadtxt("walk.csv", int, delimiter=",", skiprows=1)
    assert len(walk) == figures["steps"] + 1
    assert len(np.unique(walk, axis=0)) == np.count_nonzero(pillars)


def test_a_demo_reports_that_its_time_is_up(folder):
    ended = fasaco_edge("demo", "--map", "office", "--timeout", 0.1, "--out", "o")
    assert ended.code == 1
    assert "hint: see" in ended.err or "left over" in ended.out or "the time is up" in ended.out


@pytest.mark.parametrize("command", ["record --out .", "watch", "mission status"])
def test_a_fleet_that_no_configuration_names_is_refused(command, capsys):
    for name, said in (("", "of at least 1 letter"), ("w" * 65, "of at most 64 letters")):
        with pytest.raises(SystemExit, match="2"):
            main([*command.split(), "--fleet", name])
        assert f"--fleet: expected a text {said}" in capsys.readouterr().err


def test_a_demo_whose_daemon_refuses_shows_why(folder):
    (folder / "o").mkdir()
    (folder / "o" / "state").touch()
    ended = fasaco_edge("demo", "--map", "office", "--out", "o")
    assert ended.code == 1
    assert "the daemon ended with 78" in ended.err
    assert "cannot keep progress in o/state: o/state is not a folder" in ended.err


def test_a_recorder_without_a_folder_is_an_error(folder):
    pytest.importorskip("rerun")
    from tests.support.outsider import Outsider
    from tests.support.processes import daemon_process

    endpoint = free_endpoint()
    with daemon_process(folder, bus={"listen": [endpoint]}), Outsider(endpoint):
        ended = fasaco_edge("record", "--out", "good.npy", "--connect", endpoint)
    assert ended.code == 78
    assert "cannot record into good.npy: good.npy is not a folder" in ended.err


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--state good.npy", "cannot keep progress in good.npy: good.npy is not a folder"),
        ("--state good.npy/in", "cannot keep progress in good.npy/in: good.npy is not a folder"),
        ("--record good.npy", "cannot record into good.npy: good.npy is not a folder"),
    ],
)
def test_a_daemon_with_a_file_for_a_folder_does_not_run(folder, option, said):
    ended = fasaco_edge("run", "--state", "s", *option.split())
    assert ended.code == 78
    assert said in ended.err


def test_a_demo_on_a_full_disk_names_its_file(full_disk):
    with contextlib.suppress(OSError):
        (full_disk / "ballast").write_bytes(bytes(100_000))
    ended = fasaco_edge("demo", "--out", str(full_disk))
    assert ended.code == 1
    assert f"cannot write {full_disk / 'config.yaml'}: No space left on device" in ended.err


def test_a_failing_disk_is_no_configuration_error():
    """Of that a service would never be started again (RestartPreventExitStatus=78)."""
    # Whoever reads this file from its beginning gets an error of the device.
    ended = fasaco_edge("run", "--config", "/proc/self/mem")
    assert ended.code == 1
    assert "/proc/self/mem: Input/output error" in ended.err
    assert "check the disk" in ended.err
    assert fasaco_edge("run", "--config", "/proc/self").code == 78, "that is a mistake"


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("can't start new thread")])
def test_missing_memory_or_threads_are_an_error_with_a_hint(monkeypatch, capsys, error):
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("fasaco_edge.daemon.reload.load_config", fail)
    assert main(["run"]) == 1
    assert "out of memory or threads\n  hint: end other programs" in capsys.readouterr().err
