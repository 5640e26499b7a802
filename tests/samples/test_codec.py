"""Samples come back byte for byte, from whatever batches; what is broken or missing is said."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.samples import LARGE_BYTES, SampleDecoder, SampleEncoder, place_of

RUN = 1_700_000_000_000_000_000


def arrival(payload, topic="pose", at_ns=0, schema="a/msg/B", attachment=b""):
    sample = Sample(f"robots/{topic}", payload, schema, attachment)
    return Arrival(topic, sample, at_ns, RUN + at_ns)


def encoded(*batches, encoder=None):
    """Encode batches of samples; one that is None restarts."""
    encoder = encoder or SampleEncoder(RUN)
    blobs = []
    for batch in batches:
        if batch is None:
            encoder.restart()
            continue
        for one in batch:
            encoder.add(one)
        blobs.append(encoder.take())
    return blobs


def decoded(blobs):
    decoder = SampleDecoder()
    return [[numbered.arrival for numbered in decoder.samples(blob)] for blob in blobs]


payloads = st.one_of(
    st.binary(max_size=40),
    st.tuples(st.integers(0, 3), st.integers(0, 255)).map(
        lambda drawn: bytes(LARGE_BYTES - 1 + drawn[0]) + bytes([drawn[1]])
    ),
)
arrivals = st.builds(
    Arrival,
    st.sampled_from(["map", "pose"]),
    st.builds(Sample, st.sampled_from(["a", "b"]), payloads, st.text(max_size=3), st.binary()),
    st.integers(0, 2**62),
    st.integers(0, 2**62),
)


@given(st.lists(st.one_of(st.none(), st.lists(arrivals, min_size=1, max_size=8)), max_size=5))
def test_decoded_batches_equal_the_encoded_ones(batches):
    blobs = encoded(*batches)
    assert decoded(blobs) == [batch for batch in batches if batch is not None]


def test_numbers_count_all_samples_and_batches_know_their_place():
    blobs = encoded([arrival(b"a"), arrival(b"b", "map")], [arrival(b"c")])
    decoder = SampleDecoder()
    assert [numbered.number for blob in blobs for numbered in decoder.samples(blob)] == [0, 1, 2]
    assert [place_of(blob).first for blob in blobs] == [0, 2]
    assert {place_of(blob).run for blob in blobs} == {RUN}
    assert SampleEncoder(RUN).take() == b""


def test_a_map_that_changed_a_little_takes_a_little():
    pixels = np.random.default_rng(0).integers(0, 100, 1_000_000).astype(np.uint8)
    changed = pixels.copy()
    changed[500_000:500_200] += 1
    first, second = encoded([arrival(pixels.tobytes(), "map")], [arrival(changed.tobytes(), "map")])
    assert len(first) > 700_000
    assert len(second) < 400
    assert decoded([first, second])[1][0].sample.payload == changed.tobytes()


def test_without_earlier_batches_only_a_restart_can_be_read():
    first, second, third = encoded([arrival(b"aaaa")], [arrival(b"aaab")], None, [arrival(b"aaac")])
    with pytest.raises(MalformedMessage, match=r"sample 1 .* sample 0, which is missing"):
        SampleDecoder().samples(second)
    assert decoded([third]) == [[arrival(b"aaac")]]
    assert decoded([first, second, third])[2] == [arrival(b"aaac")]


def test_a_restart_may_tell_again_what_is_in_force():
    encoder = SampleEncoder(RUN)
    latched = encoder.add(arrival(b"map", "map"))
    first = encoder.take()
    encoder.add(arrival(b"pose"))
    encoder.restart([latched])
    second = encoder.take()
    assert place_of(second).first == 1
    told = SampleDecoder().samples(second)
    assert [numbered.number for numbered in told] == [0, 1]
    assert told[0] == latched
    # What still waits is not told twice.
    waiting = encoder.add(arrival(b"map2", "map"))
    encoder.restart([waiting])
    assert [numbered.number for numbered in SampleDecoder().samples(encoder.take())] == [2]
    assert SampleDecoder().samples(first) == [latched]


def test_an_invalid_batch_is_refused():
    (blob,) = encoded([arrival(b"payload"), arrival(b"longer payload", "map")])
    for broken in (b"", blob[:10], blob[:-1], b"\x02" + blob[1:], blob[:17] + bytes(20)):
        with pytest.raises(MalformedMessage):
            SampleDecoder().samples(broken)


@given(st.integers(0, 200), st.integers(1, 255))
def test_a_flipped_byte_changes_no_sample_unseen(place, flip):
    samples = [arrival(b"payload %d" % n, at_ns=n) for n in range(5)]
    (blob,) = encoded(samples)
    place = 17 + place % (len(blob) - 17)
    broken = blob[:place] + bytes([blob[place] ^ flip]) + blob[place + 1 :]
    try:
        told = [numbered.arrival for numbered in SampleDecoder().samples(broken)]
    except MalformedMessage:
        return
    assert told == samples
