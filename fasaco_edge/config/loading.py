"""Loading of configurations: a YAML file read and checked as a whole, with all its faults."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
from msgspec import structs

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.reading import faults_of, with_credentials, without_removed
from fasaco_edge.errors import BadConfiguration, together
from fasaco_edge.host.documents import inspected
from fasaco_edge.host.plain_yaml import read_written
from fasaco_edge.mission.orders.mask import INLINE, inline_mask


def load_config(path: Path | None) -> DaemonConfig:
    """Return the configuration in a YAML file; the defaults without a file.

    Raises:
        BadConfiguration: the file is missing, is not YAML, has unknown keys or impossible values.
            The error is the first fault, and holds the others as ``rest``.
    """
    config, faults = inspect_config(path)
    if config is None:
        raise together(faults)
    return config


def with_mask(config: DaemonConfig, file: Path | None, most_bytes: int | None) -> DaemonConfig:
    """Return a configuration that contains its keep-out mask.

    ``file``: the file of the configuration, which names the mask relative to its own place.
    ``most_bytes``: limit on the memory for reading the mask [bytes]; None for no limit.

    Raises:
        BadConfiguration: the mask cannot be read, or takes more memory than that.
    """
    mission = config.mission
    if not mission.keep_out_mask or mission.keep_out_mask.startswith(INLINE):
        return config
    path = (file or Path()).parent / mission.keep_out_mask
    mask = inline_mask(path, config.map.occupied_at_least, most_bytes)
    return structs.replace(config, mission=structs.replace(mission, keep_out_mask=mask))


def decode_config(document: bytes) -> DaemonConfig:
    """Return a configuration from the JSON that another process of the package has encoded.

    Raises:
        BadConfiguration: the document is not a configuration.
    """
    try:
        return msgspec.json.decode(document, type=DaemonConfig)
    except msgspec.DecodeError as error:
        raise BadConfiguration(f"configuration on standard input: {error}") from error


def inspect_config(
    path: Path | None, check: Callable[[DaemonConfig], object] = lambda _: None
) -> tuple[DaemonConfig | None, list[BadConfiguration]]:
    """Read a YAML file, None for the defaults; return the configuration, or None and all faults.

    ``check`` is a further check of the configuration, with defaults in place of faulty values; it
    raises BadConfiguration.
    """
    if path is None:
        return DaemonConfig(), []
    try:
        text = read_written(
            path,
            BadConfiguration,
            missing=f"name another file, or write this one: fasaco-edge init {path}",
        )
    except BadConfiguration as error:
        return None, [error]
    document, removed = without_removed({} if text.values is None else text.values)
    config, faults = inspected(DaemonConfig, with_credentials(document), BadConfiguration)
    if config:
        faults += [*removed, *faults_of(lambda: check(config))]
    faults = text.faults(faults)
    return None if faults else config, faults
