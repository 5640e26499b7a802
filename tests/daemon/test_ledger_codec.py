"""A ledger's bytes: read back as they were, and any other bytes refused."""

from __future__ import annotations

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fasaco_edge.daemon.ledger.codec import MOST_BYTES, decode_ledger, encode_ledger
from fasaco_edge.errors import LedgerFileError, LedgerMismatchError
from fasaco_edge.mission.coverage.ledger import MOST_TILES
from tests.support.ledgers import CELL_M, contents, driven, lane

CELLS = st.tuples(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6))


def enveloped(body: bytes, version: int = 1, magic: bytes = b"FASACOLG") -> bytes:
    """Return a file by the letter of its description."""
    checksum = zlib.crc32(struct.pack("<IQ", version, len(body)) + body)
    return struct.pack("<8sIIQ", magic, version, checksum, len(body)) + body


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.one_of(CELLS, st.tuples(st.integers(-3, 3), st.integers(-70, 70))), max_size=30),
    st.sampled_from([0.3, 0.1 + 0.2, 1e-3, 10.0]),
    st.text(max_size=20).filter(str.isprintable),
)
def test_what_is_written_is_read(cells, cell_m, frame):
    ledger = driven(*cells, cell_m=cell_m, frame=frame)
    assert contents(decode_ledger(encode_ledger(ledger), cell_m)) == contents(ledger)


def test_an_empty_ledger_is_a_ledger():
    assert contents(decode_ledger(encode_ledger(lane(0)), CELL_M)) == contents(lane(0))


def test_the_bytes_are_as_described():
    tile = np.zeros((64, 64), "<u2")
    tile[63, 5] = 1
    plain = struct.pack("<dQIII", 0.3, 1, 3, 1, 1) + b"map"
    plain += struct.pack("<qq", -1, 5) + struct.pack("<qq", -1, 0) + tile.tobytes()
    ledger = driven((-1, 5))
    assert contents(decode_ledger(enveloped(zlib.compress(plain)), CELL_M)) == contents(ledger)
    payload = encode_ledger(ledger)
    assert payload == enveloped(payload[24:])
    assert zlib.decompress(payload[24:]) == plain


def test_what_is_read_cannot_be_changed():
    (tile,) = decode_ledger(encode_ledger(lane(3)), CELL_M).tiles.values()
    with pytest.raises(ValueError, match="read-only"):
        tile[0, 0] = 9


def test_a_ledger_of_a_large_building_is_small():
    """Written once a second, on a memory card that wears out."""
    ledger = driven(*((row, col) for row in range(150) for col in range(150)))
    size = len(encode_ledger(ledger))
    print(f"{ledger.cells} cells: {size} bytes")
    assert size < 8_000


def test_a_file_cut_at_any_byte_is_refused():
    payload = encode_ledger(lane(9))
    for length in range(len(payload)):
        with pytest.raises(LedgerFileError):
            decode_ledger(payload[:length], CELL_M)


def test_a_file_that_goes_on_is_refused():
    with pytest.raises(LedgerFileError):
        decode_ledger(encode_ledger(lane(9)) + b"\0", CELL_M)


def test_any_bit_that_flips_is_found():
    payload = encode_ledger(lane(9))
    for bit in range(8 * len(payload)):
        flipped = bytearray(payload)
        flipped[bit // 8] ^= 1 << bit % 8
        with pytest.raises(LedgerFileError):
            decode_ledger(bytes(flipped), CELL_M)


@settings(max_examples=300, deadline=None)
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


@settings(max_examples=200, deadline=None)
@given(st.one_of(st.binary(max_size=80), st.binary(max_size=80).map(zlib.compress)))
def test_a_body_that_is_none_is_refused_although_its_checksum_holds(body):
    with pytest.raises(LedgerFileError):
        decode_ledger(enveloped(body), CELL_M)


@pytest.mark.parametrize("cell_m", [0.0, -0.3, float("nan"), float("inf")])
def test_impossible_cells_are_refused(cell_m):
    body = zlib.compress(struct.pack("<dQIII", cell_m, 0, 0, 0, 0))
    with pytest.raises(LedgerFileError):
        decode_ledger(enveloped(body), cell_m)


def test_another_file_is_no_ledger():
    with pytest.raises(LedgerFileError, match="not a ledger"):
        decode_ledger(enveloped(b"", magic=b"\x89PNG\r\n\x1a\n"), CELL_M)


def test_another_version_is_named_with_what_to_do():
    with pytest.raises(
        LedgerMismatchError, match="version 2, this release reads version 1"
    ) as told:
        decode_ledger(enveloped(b"whatever it holds", version=2), CELL_M)
    assert "install the release that wrote it" in told.value.hint
    assert "give the file its name back" in told.value.hint


def test_other_cells_are_named_with_what_to_do():
    with pytest.raises(
        LedgerMismatchError, match=r"are 0\.3 m wide, the configuration's 0\.5"
    ) as t:
        decode_ledger(encode_ledger(lane(3)), 0.5)
    assert "robot.tool_width_m to 0.3, and give the file its name back" in t.value.hint


def test_cells_that_differ_by_a_hair_are_told_apart():
    with pytest.raises(LedgerMismatchError, match=r"are 0\.3 m .* 0\.30000000000000004 m"):
        decode_ledger(encode_ledger(lane(3)), 0.1 + 0.2)


def bomb(tiles):
    """A file whose tiles take a thousand times its size."""
    head = struct.pack("<dQIII", CELL_M, 1, 3, 0, tiles) + b"map"
    places = np.array([(0, number) for number in range(tiles)], "<i8").tobytes()
    return enveloped(zlib.compress(head + places + bytes(8192 * tiles), 9))


def test_a_ledger_of_as_many_tiles_as_there_may_be_is_read():
    assert len(decode_ledger(bomb(MOST_TILES), CELL_M).tiles) == MOST_TILES


@pytest.mark.parametrize("tiles", [MOST_TILES + 1, MOST_TILES + 1000, 30_000])
def test_what_would_take_too_much_memory_is_not_read(tiles):
    payload = bomb(tiles)
    tracemalloc.start()
    try:
        with pytest.raises(LedgerFileError, match="malformed: "):
            decode_ledger(payload, CELL_M)
        assert tracemalloc.get_traced_memory()[1] < 3 * MOST_BYTES
    finally:
        tracemalloc.stop()
