"""Interface of a daemon to the package ``fleet``, loaded only if a fleet is configured."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from fasaco_edge.mission.core.company_kind import ALONE, CompanyKind
from fasaco_edge.wire.topics import FLEET

if TYPE_CHECKING:
    from fasaco_edge.bus.arrival import Sample
    from fasaco_edge.bus.session import Bus
    from fasaco_edge.config.config import DaemonConfig
    from fasaco_edge.errors import FasacoError
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.events import MemberReceived
    from fasaco_edge.wire.documents.status import FleetReport


class MessagesOfOthers(Protocol):
    """Receiver of the messages of a fleet's other robots."""

    def listen(self, bus: Bus, post: Callable[[Sample], None]) -> None:
        """Pass on the messages of this fleet within their rate limit."""

    def event(self, sample: Sample) -> MemberReceived | None:
        """Return a robot's message as an event; None from another fleet or from this robot.

        Raises:
            MalformedMessage: it is malformed.
        """

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call that ``event`` did not raise."""


class PeriodicMessage(Protocol):
    """A message that is published when it is due."""

    def publish(self, mission: Mission, now: float) -> None:
        """Publish the message if it is due at ``now`` [s, monotonic]; may raise any error."""


def company_of(config: DaemonConfig) -> CompanyKind:
    """Return the mission's kind of interface to other robots."""
    if not config.fleet:
        return ALONE
    from fasaco_edge.fleet.daemon.exchange import kind_of  # noqa: PLC0415

    return kind_of(config)


def receiver_of(config: DaemonConfig) -> MessagesOfOthers | None:
    """Return the receiver of the other robots' messages; None without a fleet."""
    if not config.fleet:
        return None
    from fasaco_edge.fleet.daemon.exchange import FleetReceiver  # noqa: PLC0415

    return FleetReceiver(config)


def sender_of(config: DaemonConfig, bus: Bus) -> PeriodicMessage | None:
    """Return the publisher of this robot's message to the others; None without a fleet."""
    if not config.fleet:
        return None
    from fasaco_edge.fleet.daemon.exchange import FleetSender  # noqa: PLC0415

    return FleetSender(bus.advertise(config.keys(), FLEET), config)


def report_of(config: DaemonConfig, mission: Mission | None, now: float) -> FleetReport | None:
    """Return the fleet's part of the status at ``now`` [s]; None without a fleet."""
    if not config.fleet:
        return None
    from fasaco_edge.fleet.daemon.exchange import report  # noqa: PLC0415

    return report(config.fleet.name, mission, now)
