"""Files that people write are read whole, or refused in a few words and little memory."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from fasaco_edge.host import plain_yaml
from fasaco_edge.host.plain_yaml import (
    MOST_BYTES,
    MOST_DEPTH,
    MOST_VALUES,
    PlainYamlError,
    compose,
    read_bounded,
)

LAUGHS = "a0: &a0 [lol,lol,lol,lol,lol,lol,lol,lol,lol,lol]\n" + "".join(
    f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 9)
)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("a: 1\nb: [x, 1.5, true, null]", {"a": 1, "b": ["x", 1.5, True, None]}),
        ("a: &x [1]\nb: *x", {"a": [1], "b": [1]}),
        ("a: &x {k: 1}\nb: {<<: *x, l: 2}", {"a": {"k": 1}, "b": {"k": 1, "l": 2}}),
        ("[5e-2, 1e7, -1E+3, 1e, a1e3]", [0.05, 1e7, -1e3, "1e", "a1e3"]),
        ("[" * MOST_DEPTH + "]" * MOST_DEPTH, None),
        ("[" + "1," * (MOST_VALUES - 1) + "]", None),
    ],
)
def test_common_yaml_is_read(text, value):
    assert value is None or compose(text)[1] == value
    compose(text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAUGHS, "line 5: more than 50000 values, aliases written out"),
        ("a: &a [*a]", "line 1: *a refers to nothing, or to itself"),
        ("a: *b", "line 1: *b refers to nothing, or to itself"),
        ("\n" + "[" * (MOST_DEPTH + 1), "line 2: nested deeper than 32 levels"),
        ("a0: &a0 [1]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}]\n" for n in range(1, 40)), "nested"),
        ("[" + "1," * MOST_VALUES + "]", "more than 50000 values"),
        ("a: !!bool maybe", "line 1: a tag, tag:yaml.org,2002:bool"),
        ("a: !!int ''", "a tag"),
        ("a: !!timestamp x", "a tag"),
        ("a: " + "9" * 5000, "line 1: an integer of more than 100 digits"),
        ("a: 0x" + "f" * 5000, "line 1: an integer of more than 100 digits"),
        ("a: " + "1:" * 400 + "1.5", "too large"),
        ('a: "\\UFFFFFFFF"', "too large" if sys.version_info < (3, 13) else "not in range"),
        ("a: 0b_", "invalid literal"),
        ("a: 2020-13-45", "month must be in 1..12"),
        ("? [1]\n: 2", "unhashable"),
        ("--- 1\n--- 2", "expected a single document"),
        ("a: [", "expected the node content"),
    ],
)
def test_other_yaml_is_refused_with_its_cause(text, said):
    with pytest.raises(PlainYamlError, match=r".*") as refused:
        compose(text)
    assert said in str(refused.value)
    assert len(str(refused.value)) < 1000


def test_a_pipe_is_read_to_its_end_with_a_timeout(tmp_path, monkeypatch):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=["a: 1"])
    writer.start()
    assert read_bounded(pipe) == "a: 1"
    writer.join()
    monkeypatch.setattr(plain_yaml, "PIPE_S", 0.1)
    with pytest.raises(PlainYamlError, match=r"the pipe was not closed within 0\.1 s"):
        read_bounded(pipe)


def test_a_billion_laughs_take_no_memory():
    """In a process of its own, with 200 MB more than it has: they stand for three gigabytes."""
    code = (
        "import resource, sys\n"
        "from fasaco_edge.host.plain_yaml import PlainYamlError, compose\n"
        "size = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (size + 200_000_000,) * 2)\n"
        "try:\n    compose(sys.stdin.read())\n"
        "except PlainYamlError as error:\n    print(error)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], input=LAUGHS, capture_output=True, text=True, check=False
    )
    assert "more than 50000 values" in ended.stdout, ended.stderr


def test_a_file_without_end_is_not_read_to_it(tmp_path):
    long = tmp_path / "long.yaml"
    long.write_bytes(b"#" * (MOST_BYTES + 1))
    for file in (long, type(long)("/dev/zero")):
        with pytest.raises(PlainYamlError, match="more than 1048576 bytes"):
            read_bounded(file)
    long.write_bytes(b"a: \xff")
    with pytest.raises(PlainYamlError, match="byte 4 is not text in UTF-8"):
        read_bounded(long)
