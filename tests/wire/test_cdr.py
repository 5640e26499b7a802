"""What the reader and the writer of CDR say where fields that go together are not all right."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter
from fasaco_edge.wire.messages.maps import write_cells
from tests.wire.decoders import DECODERS
from tests.wire.mutations import seeds_of

THREE = struct.Struct("<iIf")
NAMES = ("a", "b", "c")


@pytest.mark.parametrize(
    ("schema", "size", "field"),
    [
        (schemas.POSE_STAMPED, 4, "header.stamp.sec must be 4 bytes at offset 4"),
        (schemas.POSE_STAMPED, 11, "header.stamp.nanosec must be 4 bytes at offset 8"),
        (schemas.POSE_STAMPED, 12, "length of header.frame_id must be 4 bytes at offset 12"),
        (schemas.POSE_STAMPED, 17, "header.frame_id must be 4 bytes at offset 16"),
        (schemas.OCCUPANCY_GRID, 24, "info.map_load_time.nanosec must be 4 bytes at offset 24"),
        (schemas.OCCUPANCY_GRID, 39, "info.height must be 4 bytes at offset 36"),
        (schemas.OCCUPANCY_GRID_UPDATE, 30, "width must be 4 bytes at offset 28"),
    ],
)
def test_the_field_that_is_cut_is_named(schema: str, size: int, field: str) -> None:
    with pytest.raises(MalformedMessage) as caught:
        DECODERS[schema](seeds_of(schema)[0][:size])
    assert str(caught.value) == f"{schema}: {field}, got a payload of {size}"


def test_alignment_counts_from_behind_the_header() -> None:
    reader = CdrReader(b"\0\1\0\0" + b"\2\0\0\0a\0.." + struct.pack("<f", 2.5) + bytes(8), "m")
    assert reader.string("s") == "a"
    assert reader.words(struct.Struct("<f"), ("f",)) == (2.5,)
    reader.take(8, 0, "none")
    assert (reader.position, reader.remaining) == (16, 4)


def test_a_payload_cut_in_the_padding_names_the_next_field() -> None:
    reader = CdrReader(b"\0\1\0\0" + b"\1\0\0\0\0", "m")
    assert reader.string("s") == ""
    with pytest.raises(MalformedMessage, match="a must be 4 bytes at offset 12"):
        reader.words(THREE, NAMES)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((2**31, 0, 0.0), "a must be an int32, got 2147483648"),
        ((0, -1, 0.0), "b must be a uint32, got -1"),
    ],
)
def test_the_number_that_does_not_fit_is_named(values: tuple[float, ...], text: str) -> None:
    with pytest.raises(MalformedMessage, match=text):
        CdrWriter("m").words(THREE, NAMES, *values)


def test_a_value_that_is_no_number_raises() -> None:
    with pytest.raises(struct.error):
        CdrWriter("m").words(THREE, NAMES, 0, 1.5, 0.0)


def test_arrays_are_written_row_by_row_whatever_their_layout() -> None:
    cells = np.arange(12, dtype=np.int8).reshape(3, 4)
    for array in (cells, cells.copy(order="F"), cells[:, ::-1][:, ::-1]):
        writer = CdrWriter("m")
        write_cells(writer, array)
        assert writer.position == 16
        assert writer.payload() == b"\0\1\0\0" + b"\x0c\0\0\0" + bytes(range(12))
