"""Configuration of the page of figures that Prometheus reads."""

from __future__ import annotations

from fasaco_edge.config.reading import Section
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.addresses import Address, read_address


class MetricsConfig(Section, frozen=True):
    """Where the figures of the status are served over HTTP: ``127.0.0.1:9465``; "" for nowhere.

    Other computers may read them only where ``open_to_everyone`` is set: HTTP asks for no password.
    """

    listen: str = ""
    open_to_everyone: bool = False

    def address(self) -> Address | None:
        """Return where to listen; None for nowhere.

        Raises:
            BadConfiguration: it is no address with a port, or other computers can reach it although
                ``open_to_everyone`` is not set.
        """
        if not self.listen:
            return None
        address = read_address("metrics.listen", self.listen, example=9465)
        if not address.is_loopback and not self.open_to_everyone:
            raise BadConfiguration(
                f"metrics.listen: {self.listen} lets other computers read the status",
                hint="listen on 127.0.0.1, or set metrics.open_to_everyone",
            )
        return address
