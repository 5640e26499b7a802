"""Map files mean what they mean to map_server, and bad ones are named."""

import math
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from fasaco_edge.errors import MapFileError
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.map_files import find_map, read_bare_image, read_coverage_grid, read_map
from fasaco_edge.grid.occupancy import OccupancyGrid
from maps.map_writer import write_map
from tests.support.examples import examples

DESCRIPTION = {
    "image": "map.png",
    "resolution": 0.05,
    "origin": [-1.0, -2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}
SHARED_TMP = examples(60, suppress_health_check=[HealthCheck.function_scoped_fixture])


def described(folder, image=None, drop=(), **changes):
    """Write map.yaml, and ``image`` as map.png beside it; return the YAML's path."""
    if image is not None:
        image.save(folder / "map.png")
    keys = {key: value for key, value in {**DESCRIPTION, **changes}.items() if key not in drop}
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump(keys))
    return path


def grey(*rows, dtype=np.uint8):
    return Image.fromarray(np.array(rows, dtype))


def cell_of(brightness, mode, negate, free_thresh, occupied_thresh):
    """Return the occupancy of one opaque pixel, step by step as map_io.cpp has it."""
    if mode == "raw":
        value = round(brightness * 255)
        return value if value <= 100 else -1
    occupied = brightness if negate else 1 - brightness
    if occupied > occupied_thresh:
        return 100
    if occupied < free_thresh:
        return 0
    if mode == "trinary":
        return -1
    return round((occupied - free_thresh) / (occupied_thresh - free_thresh) * 100)


@SHARED_TMP
@given(
    # The grey 205 may be map_saver's for never seen, see tests/grid/test_map_conventions.py.
    pixels=arrays.arrays(
        np.uint8,
        arrays.array_shapes(min_dims=2, max_dims=2, max_side=6),
        elements=st.integers(0, 255).filter(lambda level: level != 205),
    ),
    mode=st.sampled_from(["trinary", "scale", "raw"]),
    negate=st.sampled_from([0, 1, True, False]),
    thresholds=st.tuples(st.integers(0, 100), st.integers(0, 100)).filter(lambda t: t[0] < t[1]),
)
def test_every_grey_in_every_mode(tmp_path, pixels, mode, negate, thresholds):
    free, occupied = thresholds[0] / 100, thresholds[1] / 100
    path = described(
        tmp_path,
        Image.fromarray(pixels),
        mode=mode,
        negate=negate,
        free_thresh=free,
        occupied_thresh=occupied,
    )
    expected = [
        [cell_of(value / 255, mode, negate, free, occupied) for value in row]
        for row in pixels[::-1].tolist()
    ]
    assert read_map(path).cells.tolist() == expected


def test_the_picture_is_turned_upright_and_placed(tmp_path):
    path = described(tmp_path, grey([0, 254, 254], [205, 254, 0]), origin=[1.5, -2, math.pi / 2])
    grid = read_map(path)
    assert grid.cells.tolist() == [[-1, 0, 100], [100, 0, 0]]
    assert grid.geometry == GridGeometry(2, 3, 0.05, Pose2D(1.5, -2.0, math.pi / 2))
    assert not grid.cells.flags.writeable


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "1"])
def test_black_is_occupied_and_white_free_in_every_kind_of_image(tmp_path, mode):
    image = grey([0, 255]).convert(mode)
    path = described(tmp_path, image, occupied_thresh=0.9, free_thresh=0.1)
    assert read_map(path).cells.tolist() == [[100, 0]]


def test_thresholds_that_are_missing_are_those_of_map_saver(tmp_path):
    image = grey([0, 254, 205, 100, 80])
    path = described(tmp_path, image, drop=("free_thresh", "occupied_thresh"))
    assert read_map(path).cells.tolist() == [[100, 0, -1, -1, 100]]


@pytest.mark.parametrize("name", ["map.png", "map.PGM", "map.bmp", "map.jpg"])
def test_an_image_with_a_resolution_is_a_map(tmp_path, name):
    # In blocks of what JPEG compresses as one.
    image = Image.fromarray(
        np.kron(np.array([[0, 255], [255, 205]]), np.ones((16, 16))).astype("B")
    )
    image.save(tmp_path / name)
    with pytest.raises(MapFileError, match="an image alone has no resolution") as refused:
        read_map(tmp_path / name)
    assert "--resolution" in refused.value.hint
    grid = read_bare_image(tmp_path / name, 0.02)
    assert grid.cells[8::16, 8::16].tolist() == [[0, -1], [100, 0]]
    assert grid.geometry == GridGeometry(32, 32, 0.02, Pose2D(0, 0, 0))


@pytest.mark.parametrize(
    ("name", "resolution_m", "said"),
    [
        ("map.yaml", 0.05, "map_server YAML file has a resolution of its own"),
        ("grid.npy", 0.05, "coverage grid has cells of --cell"),
        ("map.png", 0.05, "not an image"),
        ("map.png", -1.0, "resolution must be from"),
        ("map.png", math.nan, "resolution must be from"),
        ("none.png", 0.05, "No such file"),
    ],
)
def test_a_file_that_is_no_bare_image_is_named(tmp_path, name, resolution_m, said):
    for there in ("map.yaml", "grid.npy", "map.png"):
        (tmp_path / there).write_text("no image")
    with pytest.raises(MapFileError, match=said) as refused:
        read_bare_image(tmp_path / name, resolution_m)
    assert name in str(refused.value)


def _naming(folder, name):
    path = described(folder)
    path.write_text(path.read_text().replace("map.png", name))
    return path


@pytest.mark.parametrize(
    "text",
    ["P2\n# made by hand\n3 1\n255\n0 205 255\n", "P2 3 1 100 0 80 100", "P5 3 1 255 \x00\xcd\xff"],
)
def test_plain_and_binary_pgm(tmp_path, text):
    (tmp_path / "map.pgm").write_bytes(text.encode("latin-1"))
    assert read_map(_naming(tmp_path, "map.pgm")).cells.tolist() == [[100, -1, 0]]


def test_sixteen_bit_images_are_read(tmp_path):
    image = grey([0, 32768, 65535], dtype=np.uint16)
    assert read_map(described(tmp_path, image, mode="scale")).cells.tolist() == [[100, 67, 0]]
    (tmp_path / "map.pgm").write_bytes(b"P5 2 1 65535 \x00\x00\xff\xff")
    assert read_map(_naming(tmp_path, "map.pgm")).cells.tolist() == [[100, 0]]


def test_colours_are_averaged_evenly(tmp_path):
    image = Image.new("RGB", (1, 1), (255, 0, 0))
    path = described(tmp_path, image, mode="scale", free_thresh=0.0, occupied_thresh=1.0)
    assert read_map(path).cells.tolist() == [[67]]


@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_alpha_does_not_count_as_brightness_but_marks_unknown(tmp_path, mode):
    row = [(0, 0, 0, 255), (255, 255, 255, 255), (0, 0, 0, 0), (255, 255, 255, 254)]
    image = Image.fromarray(np.array([row], np.uint8))
    path = described(tmp_path, image, mode=mode, occupied_thresh=0.9)
    assert read_map(path).cells.tolist() == [[100, 0, -1, -1]]


def test_alpha_does_not_matter_to_raw_values(tmp_path):
    image = Image.fromarray(np.array([[[42, 0], [100, 255], [101, 255]]], np.uint8))
    assert read_map(described(tmp_path, image, mode="raw")).cells.tolist() == [[42, 100, -1]]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"mode": "binary"}, "mode: expected trinary, scale or raw, got 'binary'"),
        ({"free_thresh": -0.1}, "free_thresh: expected a number of at least 0, got -0.1"),
        ({"free_thresh": 0.7}, "free_thresh: must be less than occupied_thresh, 0.65, got 0.7"),
        ({"resolution": math.nan}, "resolution: expected a number of at least 0.0001, got nan"),
        ({"resolution": 1e300}, "expected a number of at most 100, got 1e+300"),
        ({"resolution": [["lol"] * 9] * 9}, "resolution: expected a number, got [['lol', "),
        ({"origin": [1e300, 0, 0]}, "origin[0]: expected a number of at most 20000000, got 1e+300"),
        ({"mode": "\x1b[2J"}, r"got '\x1b[2J'"),
        ({"origin": [0, 0]}, "origin: expected a list of 3 items, got [0, 0]"),
        ({"origin": [0, 0, math.inf]}, "origin[2]: expected a number of at most 20000000, got inf"),
        ({"negate": "maybe"}, "negate: expected 0 or 1, got 'maybe'"),
        ({"image": ""}, "image: expected a text of at least 1 letter, got ''"),
        ({"image": "none.pgm"}, "image: no file"),
    ],
)
def test_impossible_values_are_named(tmp_path, changes, expected):
    grey([0]).save(tmp_path / "map.png")
    path = tmp_path / "map.yaml"
    path.write_text(yaml.safe_dump({**DESCRIPTION, **changes}))
    with pytest.raises(MapFileError) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"{path}, line ")
    assert expected in str(caught.value)


@pytest.mark.parametrize("key", ["image", "resolution", "origin", "negate"])
def test_missing_keys_are_named(tmp_path, key):
    path = described(tmp_path, grey([0]), drop=[key])
    with pytest.raises(MapFileError, match=f"{key}: missing"):
        read_map(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("resolutoin: 0.05", "resolutoin: unknown key; did you mean resolution?"),
        ("", "image: missing"),
        ("- a", "expected a mapping such as {image: ..."),
    ],
)
def test_an_incomplete_map_file_error_lists_its_keys(tmp_path, text, said):
    grey([0]).save(tmp_path / "map.png")
    path = tmp_path / "map.yaml"
    rest = {key: value for key, value in DESCRIPTION.items() if key != "resolution"}
    path.write_text(f"{text}\n{yaml.safe_dump(rest)}" if ":" in text else text)
    with pytest.raises(MapFileError) as caught:
        read_map(path)
    assert any(said in str(fault) for fault in (caught.value, *caught.value.rest))


def test_numbers_may_be_in_quotes(tmp_path):
    grey([0]).save(tmp_path / "map.png")
    path = tmp_path / "map.yaml"
    changes = {"resolution": "0.05", "free_thresh": "0.2", "origin": ["-1.5", 2, "-.5"]}
    path.write_text(yaml.safe_dump(DESCRIPTION | changes).replace("'-.5'", "-.5"))
    geometry = read_map(path).geometry
    assert (geometry.resolution, geometry.origin) == (0.05, Pose2D(-1.5, 2, -0.5))


def test_all_keys_are_judged_at_once(tmp_path):
    path = tmp_path / "map.yaml"
    path.write_text(
        "image: none.png\nresolution: 0,05\norigin: [0, 0]\nocupied_thresh: 0.6\n"
        "mode: Trinary\nmode: scale\ncost_translation: {}\n"
    )
    with pytest.raises(MapFileError) as caught:
        read_map(path)
    faults = [caught.value, *caught.value.rest]
    assert [(fault.line, fault.key) for fault in faults] == [
        *((None, "negate"), (1, "image"), (2, "resolution"), (3, "origin")),
        *((4, "ocupied_thresh"), (6, "mode")),
    ]
    assert "expected a number with a decimal point, got '0,05'" in faults[2].what
    assert faults[5].hint == "mode is trinary for maps of map_saver"


@pytest.mark.parametrize(
    "text", ["", "- a\n- b\n", "just words", "a: [1", "\x00", "[" * 5000, "a: 2020-13-45"]
)
def test_not_a_mapping(tmp_path, text):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(MapFileError, match=r"map\.yaml"):
        read_map(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MapFileError, match=r"none\.yaml"):
        read_map(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    "content", [b"", b"not an image", b"P5 0 3 255 ", b"P5 3 3 255 \x00", b"Pf 1 1 -1 \0\0\0\0"]
)
def test_not_an_image(tmp_path, content):
    (tmp_path / "map.png").write_bytes(content)
    with pytest.raises(MapFileError, match=r"map\.png"):
        read_map(described(tmp_path))


def _png_of_size(width, height):
    def chunk(kind, content):
        crc = struct.pack(">I", zlib.crc32(kind + content))
        return struct.pack(">I", len(content)) + kind + content + crc

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


@pytest.mark.parametrize("side", [8001, 10_000, 20_000, 2**31 - 1])
def test_absurd_sizes_are_refused_by_their_header(tmp_path, side):
    (tmp_path / "map.png").write_bytes(_png_of_size(side, side))
    with pytest.raises(MapFileError, match=r"map\.png: .*64000000 pixels"):
        read_map(described(tmp_path))


@SHARED_TMP
@given(place=st.integers(0, 10_000), value=st.integers(0, 255), end=st.integers(0, 10_000))
@pytest.mark.parametrize("suffix", [".png", ".pgm", ".bmp"])
def test_damaged_images_are_read_or_refused(tmp_path, suffix, place, value, end):
    image = tmp_path / f"map{suffix}"
    grey([0, 255, 7], [1, 2, 3]).save(image)
    damaged = bytearray(image.read_bytes())
    damaged[place % len(damaged)] = value
    image.write_bytes(damaged[: end % (2 * len(damaged)) + 1])
    try:
        grid = read_map(_naming(tmp_path, image.name))
    except MapFileError:
        return
    assert grid.cells.size > 0


@SHARED_TMP
@given(
    cells=arrays.arrays(
        np.int8,
        arrays.array_shapes(min_dims=2, max_dims=2, max_side=12),
        elements=st.sampled_from([-1, 0, 100]),
    ),
    resolution=st.floats(1e-3, 10),
    pose=st.tuples(*[st.floats(-2e7, 2e7)] * 3),
)
def test_a_written_map_is_read_back(tmp_path, cells, resolution, pose):
    grid = OccupancyGrid(GridGeometry(*cells.shape, resolution, Pose2D(*pose)), cells)
    write_map(grid, tmp_path / "written.yaml")
    again = read_map(tmp_path / "written.yaml")
    assert again.geometry == grid.geometry
    np.testing.assert_array_equal(again.cells, cells)


def test_probabilities_are_written_as_free_occupied_or_unknown(tmp_path):
    cells = np.array([[0, 25, 26, 64, 65, 100, -1]], np.int8)
    write_map(OccupancyGrid(GridGeometry(1, 7, 0.05, Pose2D(0, 0)), cells), tmp_path / "w.yaml")
    assert read_map(tmp_path / "w.yaml").cells.tolist() == [[0, 0, -1, -1, 100, 100, -1]]


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((2, 2), np.uint8),
        np.zeros(3, bool),
        np.zeros((2, 2, 2), bool),
        np.zeros((0, 3), bool),
        np.array([[None]], object),
    ],
)
def test_other_arrays_are_refused(tmp_path, array):
    np.save(tmp_path / "grid.npy", array, allow_pickle=True)
    with pytest.raises(MapFileError, match=r"grid\.npy"):
        read_coverage_grid(tmp_path / "grid.npy")


def test_any_byte_but_zero_of_a_coverage_grid_is_true(tmp_path):
    cells = np.array([[0, 1], [2, 255]], np.uint8)
    np.save(tmp_path / "grid.npy", np.asfortranarray(cells).view(bool))
    read = read_coverage_grid(tmp_path / "grid.npy")
    np.testing.assert_array_equal(read.view(np.uint8), cells != 0)
    assert read.flags.c_contiguous


def _npy_header(shape):
    text = f"{{'descr': '|b1', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"words",
        b"\x93NUMPY\x01\x00",
        _npy_header("(3, 3)") + b"\1\1",
        _npy_header("(100000, 100000)"),
        _npy_header(f"({10**30}, 1)"),
        _npy_header("(-1, -1)") + b"\1",
        _npy_header("(True, 2)") + b"\1\1",
    ],
)
def test_no_coverage_grid(tmp_path, content):
    (tmp_path / "grid.npy").write_bytes(content)
    with pytest.raises(MapFileError, match=r"grid\.npy"):
        read_coverage_grid(tmp_path / "grid.npy")


def test_an_archive_is_no_coverage_grid(tmp_path):
    with open(tmp_path / "grid.npy", "wb") as file:
        np.savez(file, np.ones((2, 2), bool))
    with pytest.raises(MapFileError, match="an archive of arrays"):
        read_coverage_grid(tmp_path / "grid.npy")


@pytest.mark.parametrize("name", ["palace", "", "x" * 5000, "../maps/office", "~nobody-here/x"])
def test_an_unknown_map_gives_the_known_names(name):
    with pytest.raises(MapFileError, match=r"built-in map \(.*basement"):
        find_map(name)


def test_pillow_is_loaded_with_the_first_image_only():
    source = "import sys, fasaco_edge.grid.map_files; sys.exit('PIL' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", source], check=False).returncode == 0
