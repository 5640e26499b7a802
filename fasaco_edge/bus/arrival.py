"""Samples from the bus, and their times of arrival."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import zenoh


class Sample:
    """A message from the bus.

    Payload and attachment stay in Zenoh's buffers until they are read: a message that is replaced
    unread is never copied.

    Attributes:
        key: its key.
        schema: message type in its encoding; "" without a type.
        size: size of payload and attachment together [bytes].
        sender: id of the session that published it, as stated in the sample; "" if unknown. If the
            session sets no timestamps, the sender may be the first router on the way, or this
            session.
    """

    __slots__ = ("_attachment", "_payload", "key", "schema", "sender", "size")

    def __init__(
        self,
        key: str,
        payload: bytes | zenoh.ZBytes,
        schema: str = "",
        attachment: bytes | zenoh.ZBytes = b"",
        sender: str = "",
    ) -> None:
        self.key = key
        self.sender = sender
        self.schema = schema
        self.size = len(payload) + len(attachment)
        self._payload = payload
        self._attachment = attachment

    @classmethod
    def of(cls, sample: zenoh.Sample) -> Sample:
        """Return a sample delivered by Zenoh."""
        attachment = b"" if sample.attachment is None else sample.attachment
        schema = schema_of(sample.encoding)
        return cls(str(sample.key_expr), sample.payload, schema, attachment, _sender_of(sample))

    @property
    def payload(self) -> bytes:
        """The message itself."""
        if not isinstance(self._payload, bytes):
            self._payload = self._payload.to_bytes()
        return self._payload

    @property
    def attachment(self) -> bytes:
        """The attachment of the message."""
        if not isinstance(self._attachment, bytes):
            self._attachment = self._attachment.to_bytes()
        return self._attachment

    def as_type(self, schema: str) -> Sample:
        """Return the sample as a message of another type."""
        return Sample(self.key, self._payload, schema, self._attachment, self.sender)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sample) and self._fields() == other._fields()

    def __hash__(self) -> int:
        return hash(self._fields())

    def __repr__(self) -> str:
        return f"Sample({self.key!r}, {self.size} bytes, {self.schema!r})"

    def _fields(self) -> tuple[str, bytes, str, bytes]:
        return self.key, self.payload, self.schema, self.attachment


def _sender_of(sample: zenoh.Sample) -> str:
    """Return the id of the session that published a sample, else of the session that stamped it."""
    if sample.source_info is not None:
        return str(sample.source_info.source_id.zid)
    return str(sample.timestamp).partition("/")[2] if sample.timestamp is not None else ""


def schema_of(encoding: zenoh.Encoding) -> str:
    """Return the message type named by an encoding, or ""."""
    return str(encoding).partition(";")[2]


@dataclass(frozen=True, slots=True)
class Arrival:
    """A sample, its topic and its time of arrival.

    Attributes:
        topic: name of its row in ``wire.topics``: "map", "pose" ...
        sample: the sample.
        at_ns: time of arrival by the monotonic clock [ns].
        wall_ns: time of arrival since the epoch [ns].
    """

    topic: str
    sample: Sample
    at_ns: int
    wall_ns: int
