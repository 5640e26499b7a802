"""A ledger's bytes: read back as they were, and any other bytes refused."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.daemon.ledger.codec import MOST_BYTES, decode_ledger, encode_ledger
from fasaco_edge.errors import LedgerFileError, LedgerMismatchError
from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.floor_tiles import NO_FLOOR
from fasaco_edge.mission.coverage.ledger import MOST_TILES, LedgerSnapshot
from fasaco_edge.mission.coverage.swept_floor import MOST_FLOOR_TILES
from fasaco_edge.planners.living_trail import NO_TRAIL, TrailSnapshot
from tests.support.examples import examples
from tests.support.ledgers import CELL_M, contents, driven, lane

CELLS = st.tuples(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6))


def enveloped(body: bytes, version: int = 3, magic: bytes = b"FASACOLG") -> bytes:
    """Return a file by the letter of its description."""
    checksum = zlib.crc32(struct.pack("<IQ", version, len(body)) + body)
    return struct.pack("<8sIIQ", magic, version, checksum, len(body)) + body


def trail_of(*values: float) -> TrailSnapshot:
    """Return a trail of two cells, from cell (-7, 9) on."""
    return TrailSnapshot(Window(-7, 9, -6, 11), np.array(values, np.float32).reshape(1, 2, 4))


def all_of(ledger: LedgerSnapshot) -> object:
    return contents(ledger), ledger.trail.window, ledger.trail.tau.tobytes()


@examples(60)
@given(
    st.lists(st.one_of(CELLS, st.tuples(st.integers(-3, 3), st.integers(-70, 70))), max_size=30),
    st.sampled_from([0.3, 0.1 + 0.2, 1e-3, 1.0]),
    st.text(max_size=20).filter(str.isprintable),
)
def test_a_decoded_ledger_equals_the_encoded_one(cells, cell_m, frame):
    ledger = driven(*cells, cell_m=cell_m, frame=frame)
    assert contents(decode_ledger(encode_ledger(ledger), cell_m)) == contents(ledger)


def test_the_bytes_are_as_described():
    tile = np.zeros((64, 64), "<u2")
    tile[63, 5] = 1
    # The tool's disc, on pixels of 2.5 cm; its middle is at x = 1.65 m, y = -0.15 m.
    rows, cols = np.mgrid[-128:0, 0:128] + 0.5
    swept = np.hypot(0.025 * cols - 1.65, 0.025 * rows + 0.15) <= 0.15
    plain = struct.pack("<dQIIIIII", 0.3, 1, 3, 1, 1, 1, 1, 2) + b"map"
    plain += struct.pack("<qq", -1, 5) + struct.pack("<qq", -1, 0) + tile.tobytes()
    plain += struct.pack("<qq", -1, 0) + np.packbits(swept, axis=1).tobytes()
    plain += struct.pack("<qq", -7, 9)
    plain += bytes.fromhex("3d00003f3d003f00") + bytes.fromhex("cd000080cd008000")
    ledger = replace(driven((-1, 5)), trail=trail_of(0.1, 0, 0, 1.0, 0.1, 0, 1.0, 0))
    read = decode_ledger(enveloped(zlib.compress(plain)), CELL_M)
    # 0.1 is 0x3dcccccd as float32: its first half is rounded up.
    rounded = trail_of(0.10009765625, 0, 0, 1.0, 0.10009765625, 0, 1.0, 0)
    assert all_of(read) == all_of(replace(ledger, trail=rounded))
    payload = encode_ledger(ledger)
    assert payload == enveloped(payload[24:])
    assert zlib.decompress(payload[24:]) == plain


@examples(60)
@given(st.lists(st.floats(1e-12, 1e6), min_size=8, max_size=8))
def test_a_trail_is_kept_to_a_share_of_itself_and_then_as_it_is(values):
    ledger = replace(lane(3), trail=trail_of(*values))
    read = decode_ledger(encode_ledger(ledger), CELL_M)
    np.testing.assert_allclose(read.trail.tau, ledger.trail.tau, rtol=0.004)
    assert all_of(decode_ledger(encode_ledger(read), CELL_M)) == all_of(read)


def test_floor_swept_by_a_fleet_has_a_format_version_of_its_own():
    ledger = replace(driven((-1, 5)), fleet=b'{"version": 1}', note="{}")
    payload = encode_ledger(ledger)
    assert struct.unpack_from("<I", payload, 8) == (4,)
    read = decode_ledger(payload, CELL_M)
    assert (read.fleet, read.note) == (ledger.fleet, ledger.note)
    assert contents(read) == contents(ledger)


@pytest.mark.parametrize("fleet", [b"", b'{"version": 1}'])
def test_cells_at_an_angle_are_kept_in_a_version_of_their_own(fleet):
    ledger = replace(driven((-1, 5)), lattice_deg=-29.7, fleet=fleet, note="{}")
    payload = encode_ledger(ledger)
    assert struct.unpack_from("<I", payload, 8) == (5,)
    read = decode_ledger(payload, CELL_M)
    assert (read.lattice_deg, read.fleet, read.note) == (-29.7, fleet, "{}")
    assert contents(read) == contents(ledger)


@pytest.mark.parametrize("lattice_deg", [float("nan"), float("inf"), -91.0])
def test_an_impossible_angle_is_refused(lattice_deg):
    with pytest.raises(LedgerFileError, match="cells at"):
        decode_ledger(encode_ledger(replace(driven((0, 0)), lattice_deg=lattice_deg)), CELL_M)


def test_a_ledger_without_a_trail_is_read_with_none():
    plain = struct.pack("<dQIIII", 0.3, 0, 3, 0, 0, 0) + b"map" + b"{}"
    ledger = decode_ledger(enveloped(zlib.compress(plain), version=2), CELL_M)
    assert ledger.trail is NO_TRAIL
    assert ledger.note == "{}"


@pytest.mark.parametrize("value", ["ff80", "7f80", "7fc0", "bf80"])
def test_impossible_pheromone_is_refused(value):
    plain = struct.pack("<dQIIIIII", 0.3, 0, 3, 0, 0, 0, 1, 1) + b"map" + bytes(16)
    plain += bytes.fromhex(value[:2]) * 4 + bytes.fromhex(value[2:]) * 4
    with pytest.raises(LedgerFileError, match="pheromone below 0, or not finite"):
        decode_ledger(enveloped(zlib.compress(plain)), CELL_M)


def test_a_trail_larger_than_any_lattice_is_not_read():
    plain = struct.pack("<dQIIIIII", 0.3, 0, 3, 0, 0, 0, 2**31, 2**31) + b"map" + bytes(16)
    with pytest.raises(LedgerFileError, match="trail of 2147483648 x 2147483648 cells"):
        decode_ledger(enveloped(zlib.compress(plain)), CELL_M)


def test_a_ledger_of_the_previous_version_has_no_swept_floor():
    tile = np.zeros((64, 64), "<u2")
    tile[63, 5] = 1
    plain = struct.pack("<dQIII", 0.3, 1, 3, 1, 1) + b"map"
    plain += struct.pack("<qq", -1, 5) + struct.pack("<qq", -1, 0) + tile.tobytes() + b"{}"
    ledger = decode_ledger(enveloped(zlib.compress(plain), version=1), CELL_M)
    assert contents(ledger) == contents(replace(driven((-1, 5)), floor=NO_FLOOR))
    assert ledger.note == "{}"
    assert not ledger.is_empty


def test_a_decoded_ledger_is_read_only():
    ledger = decode_ledger(encode_ledger(lane(3)), CELL_M)
    for tile in (*ledger.tiles.values(), *ledger.floor.tiles.values()):
        with pytest.raises(ValueError, match="read-only"):
            tile[0, 0] = 9


def test_a_ledger_of_a_large_building_is_small():
    """Written once a second, on a memory card that wears out."""
    ledger = driven(*((row, col) for row in range(150) for col in range(150)))
    size = len(encode_ledger(ledger))
    print(f"{ledger.cells} cells: {size} bytes")
    assert size < 12_000


def test_a_file_cut_longer_or_with_a_flipped_bit_is_refused():
    payload = encode_ledger(lane(9))
    broken = [payload + b"\0", *(payload[:length] for length in range(len(payload)))]
    for bit in range(8 * len(payload)):
        flipped = bytearray(payload)
        flipped[bit // 8] ^= 1 << bit % 8
        broken.append(bytes(flipped))
    for one in broken:
        with pytest.raises(LedgerFileError):
            decode_ledger(one, CELL_M)


@examples(300)
@given(st.data())
def test_torn_and_scribbled_files_are_found(data):
    """A sector of zeros, of another file, or of noise; a tail that was never written."""
    payload = encode_ledger(driven(*((row, row * row % 90) for row in range(40))))
    start = data.draw(st.integers(0, len(payload) - 1))
    end = data.draw(st.integers(start + 1, len(payload)))
    noise = data.draw(
        st.one_of(
            st.just(bytes(end - start)),
            st.binary(min_size=end - start, max_size=end - start),
            st.binary(max_size=8),
        )
    )
    broken = payload[:start] + noise + payload[end:]
    if broken != payload:
        with pytest.raises(LedgerFileError):
            decode_ledger(broken, CELL_M)


@examples(200)
@given(st.one_of(st.binary(max_size=80), st.binary(max_size=80).map(zlib.compress)))
def test_an_invalid_body_with_a_valid_checksum_is_refused(body):
    with pytest.raises(LedgerFileError):
        decode_ledger(enveloped(body), CELL_M)


@pytest.mark.parametrize("version", [1, 2, 3])
@pytest.mark.parametrize("cell_m", [0.0, -0.3, float("nan"), float("inf")])
def test_impossible_cells_are_refused(cell_m, version):
    counts = (0,) * (3, 4, 6, 7)[version - 1]
    body = zlib.compress(struct.pack(f"<dQ{len(counts)}I", cell_m, 0, *counts) + bytes(16))
    with pytest.raises(LedgerFileError, match="cells of"):
        decode_ledger(enveloped(body, version), cell_m)


def test_another_file_is_no_ledger():
    with pytest.raises(LedgerFileError, match="not a ledger"):
        decode_ledger(enveloped(b"", magic=b"\x89PNG\r\n\x1a\n"), CELL_M)


def test_other_cells_without_floor_are_named_with_what_to_do():
    bare = replace(lane(3), floor=NO_FLOOR)
    with pytest.raises(
        LedgerMismatchError, match=r"are 0\.3 m wide, the configuration's 0\.5"
    ) as t:
        decode_ledger(encode_ledger(bare), 0.5)
    assert "set robot.tool_width_m to 0.3 (and robot.overlap, planner.line" in t.value.hint
    assert "rename the file back" in t.value.hint
    assert decode_ledger(encode_ledger(lane(3)), 0.5).cell_m == 0.3


def bomb(tiles, floor):
    """A file whose tiles take a thousand times its size."""
    head = struct.pack("<dQIIIIII", CELL_M, 1, 3, 0, tiles, floor, 0, 0) + b"map"
    places = [np.array([(0, n) for n in range(count)], "<i8").tobytes() for count in (tiles, floor)]
    plain = head + places[0] + bytes(8192 * tiles) + places[1] + bytes(2048 * floor + 16)
    return enveloped(zlib.compress(plain, 9))


def test_the_largest_allowed_ledger_is_read():
    ledger = decode_ledger(bomb(MOST_TILES, MOST_FLOOR_TILES), CELL_M)
    assert (len(ledger.tiles), len(ledger.floor.tiles)) == (MOST_TILES, MOST_FLOOR_TILES)


@pytest.mark.parametrize(
    ("tiles", "floor"),
    [(MOST_TILES + 1, 0), (MOST_TILES + 1000, 9), (30_000, 0), (0, MOST_FLOOR_TILES + 1)],
)
def test_a_file_that_expands_too_far_is_refused(tiles, floor):
    payload = bomb(tiles, floor)
    tracemalloc.start()
    try:
        with pytest.raises(LedgerFileError, match="malformed: "):
            decode_ledger(payload, CELL_M)
        assert tracemalloc.get_traced_memory()[1] < 3 * MOST_BYTES
    finally:
        tracemalloc.stop()


def test_writing_the_largest_ledger_takes_the_memory_of_its_file():
    ledger = decode_ledger(bomb(MOST_TILES, MOST_FLOOR_TILES), CELL_M)
    tracemalloc.start()
    try:
        payload = encode_ledger(ledger)
        assert tracemalloc.get_traced_memory()[1] < 4 * len(payload) + 2_000_000
    finally:
        tracemalloc.stop()
