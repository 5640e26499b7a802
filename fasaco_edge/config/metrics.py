"""Configuration of the page of figures that Prometheus reads."""

from __future__ import annotations

import ipaddress
import re
from typing import NamedTuple

from fasaco_edge.config.reading import Section
from fasaco_edge.errors import BadConfiguration

_ADDRESS = re.compile(r"(?:\[(?P<six>[0-9a-fA-F:]+)\]|(?P<four>[\w.]+)):(?P<port>\d{1,5})")


class Address(NamedTuple):
    """Where a server listens: host, an address as text, and port."""

    host: str
    port: int


class MetricsConfig(Section, frozen=True):
    """Where the figures of the status are served over HTTP: ``127.0.0.1:9465``; "" for nowhere.

    Other computers may read them only where ``open_to_everyone`` is set: HTTP asks for no password.
    """

    listen: str = ""
    open_to_everyone: bool = False

    def address(self) -> Address | None:
        """Return where to listen; None for nowhere.

        Raises:
            BadConfiguration: it is no address with a port, or lets others in unasked.
        """
        if not self.listen:
            return None
        found = _ADDRESS.fullmatch(self.listen)
        wrong = BadConfiguration(
            f"metrics.listen must be an address and a port, as 127.0.0.1:9465 or [::1]:9465, "
            f"got {self.listen!r}"
        )
        if found is None or not 0 < int(found["port"]) < 1 << 16:
            raise wrong
        host = found["six"] or found["four"]
        host = "127.0.0.1" if host == "localhost" else host
        try:
            is_local = ipaddress.ip_address(host).is_loopback
        except ValueError as error:
            raise wrong from error
        if not is_local and not self.open_to_everyone:
            raise BadConfiguration(
                f"metrics.listen: {self.listen} lets other computers read the status",
                hint="listen on 127.0.0.1, or set metrics.open_to_everyone",
            )
        return Address(host, int(found["port"]))
