"""Loading of configurations: a YAML file read and checked as a whole, with all its faults."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
from msgspec import structs

from fasaco_edge.config.config import DaemonConfig, FleetConfig
from fasaco_edge.config.endpoints import endpoint_faults
from fasaco_edge.config.reading import (
    Fault,
    read_text,
    section_faults,
    with_credentials,
    without_removed,
)
from fasaco_edge.config.ros import RosConfig
from fasaco_edge.config.security import security_faults
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.mission.orders.commands import order_faults
from fasaco_edge.mission.orders.mask import INLINE, inline_mask, mask_polygons
from fasaco_edge.wire.keys import Keys


def load_config(path: Path | None) -> DaemonConfig:
    """Read a YAML file; without one return the defaults.

    Raises:
        BadConfiguration: the file is missing, is no YAML, has unknown keys or
            impossible values; the text names key, value and allowed values.
    """
    config, faults = inspect_config(path)
    if config is not None:
        return config
    first, *more = faults
    where = f"{path}, line {first.line}" if first.line else str(path)
    hint = first.error.hint
    if more:
        hint += f"; there are more: fasaco-edge check-config {path}"
    raise type(first.error)(f"{where}: {first.error}", hint=hint) from first.error


def with_mask(config: DaemonConfig, file: Path | None, most_bytes: int | None) -> DaemonConfig:
    """Return a configuration that contains its keep-out mask.

    Args:
        config: configuration that names a mask file, relative to its own folder.
        file: the file of the configuration.
        most_bytes: limit on the memory for reading the mask [bytes]; None for no limit.

    Raises:
        BadConfiguration: the mask cannot be read, or takes more memory.
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
        BadConfiguration: it is no configuration.
    """
    try:
        return msgspec.json.decode(document, type=DaemonConfig)
    except msgspec.DecodeError as error:
        raise BadConfiguration(f"configuration on standard input: {error}") from error


def inspect_config(
    path: Path | None, check: Callable[[DaemonConfig], object] = lambda _: None
) -> tuple[DaemonConfig | None, tuple[Fault, ...]]:
    """Read a YAML file; return the configuration, or None and all faults.

    Values are checked for conflicts with each other where none of them is faulty.

    Args:
        path: the file; None for the defaults.
        check: a further check of these sections; raises BadConfiguration.
    """
    if path is None:
        return DaemonConfig(), ()
    try:
        text = read_text(path)
    except BadConfiguration as error:
        return None, (Fault("", error),)
    faults = [*text.duplicates, *section_faults(DaemonConfig, text.document)]
    document = text.document if isinstance(text.document, dict) else {}
    sound = _sound(document, {fault.key for fault in faults})
    config = msgspec.convert(with_credentials(without_removed(sound)), DaemonConfig)
    unclear = {key for fault in faults for key in _keys_in(f"{fault.key} {fault.error}")}
    misfits = [*_misfits(config), *_refused("", lambda: check(config))]
    found = [
        error
        for error in misfits
        if not any(_concern(key, each) for key in _keys_in(str(error)) for each in unclear)
    ]
    known = {fault.key for fault in faults}
    found += [
        error
        for error in _zone_faults(document)
        if not any(_concern(_named_in(error), each) for each in known)
    ]
    faults += [Fault(_named_in(error), error) for error in found]
    if not faults:
        return config, ()
    return None, tuple(
        replace(fault, line=fault.line or text.line_of(fault.key)) for fault in faults
    )


SECTIONS = tuple(field.encode_name for field in structs.fields(DaemonConfig))


def _sound(document: dict[str, object], faulty: set[str]) -> dict[str, object]:
    """Return the sections of a document without their faulty keys, as far as they stand so."""
    left_out = {".".join(re.split(r"[.\[]", key)[:2]) for key in faulty}
    sound = {
        name: {key: value for key, value in part.items() if f"{name}.{key}" not in left_out}
        for name, part in document.items()
        if name in SECTIONS and name not in left_out and isinstance(part, dict)
    }
    return {
        name: part
        for name, part in sound.items()
        if not any(section_faults(DaemonConfig, {name: part}))
    }


def _zone_faults(document: dict[str, object]) -> Iterator[BadConfiguration]:
    """Yield what is wrong with the standing zones and keep-outs, as with those of an order."""
    mission = document.get("mission")
    given = mission if isinstance(mission, dict) else {}
    order = {name: given[name] for name in ("zones", "keep_out") if name in given}
    for error in order_faults(order):
        yield BadConfiguration(f"mission.{error}")


def _keys_in(text: str) -> list[str]:
    """Return the keys that a text names, and the sections."""
    found = re.findall(r"[a-z]\w*(?:\.[a-z]\w*|\[\d+\])*", text)
    return [key for key in found if re.split(r"[.\[]", key)[0] in SECTIONS]


def _concern(named: str, faulty: str) -> bool:
    """Return whether a key equals, lies in, or (unless a section) contains a faulty one."""
    is_in = f"{named}.".startswith((f"{faulty}.", f"{faulty}["))
    return is_in or ("." in named and faulty.startswith((f"{named}.", f"{named}[")))


def _named_in(error: BadConfiguration) -> str:
    """Return the key at the start of an error."""
    match = re.match(r"[\w.\[\]]*", str(error))
    return match[0] if match else ""


def _misfits(config: DaemonConfig) -> Iterator[BadConfiguration]:
    """Yield conflicts between values."""
    low, high = config.map.free_at_most, config.map.occupied_at_least
    if low >= high:
        yield BadConfiguration(
            f"map.free_at_most must be below map.occupied_at_least, got {low} and {high}"
        )
    bus = config.bus
    if not (bus.listen or bus.connect):
        yield BadConfiguration("bus.listen and bus.connect must not both be empty")
    yield from endpoint_faults("bus.listen", bus.listen)
    yield from endpoint_faults("bus.connect", bus.connect)
    yield from security_faults(
        bus.security, bus.listen, bus.connect, open_to_everyone=bus.open_to_everyone
    )
    if bus.security.roles.ros and not config.ros2:
        yield BadConfiguration("bus.security.roles.ros: without a block ros2 there is no such role")
    part_mb, quota_mb = config.recording.part_mb, config.recording.quota_mb
    if 0 < quota_mb < 2 * part_mb:
        yield BadConfiguration(
            f"recording.quota_mb must be 0 or at least twice recording.part_mb, {2 * part_mb}, "
            f"got {quota_mb}"
        )
    yield from _refused("", config.metrics.address)
    if "\0" in config.mission.state_dir:
        yield BadConfiguration("mission.state_dir must be a path, got one with a NUL")
    if (battery := config.battery) and battery.enough < max(battery.low, battery.reserve) + 0.1:
        yield BadConfiguration(
            "battery.enough must be at least 0.1 above battery.low and battery.reserve, got "
            f"{battery.enough:g}, {battery.low:g} and {battery.reserve:g}"
        )
    if config.fleet:
        yield from _fleet_misfits(config.fleet)
    if config.ros2:
        yield from _ros_misfits(config, config.ros2)
    yield from _refused("bus.", lambda: Keys(base=config.bus.base))
    yield from _refused("robot.name: ", lambda: Keys(robot=config.robot.name))
    yield from _refused("robot: ", config.robot.cost)
    if footprint := config.robot.footprint:
        faults = list(footprint.faults())
        for error in faults:
            yield BadConfiguration(f"robot.footprint: {error}")
        radius_m = config.robot.radius_m
        if not faults and abs(radius_m - footprint.radius()) > 1e-6:
            yield BadConfiguration(
                f"robot.radius_m must be left out beside robot.footprint, whose disc has "
                f"{footprint.radius():.3g} m, got {radius_m:g}"
            )
    yield from _refused("planner.", config.planner.colony)
    mask = config.mission.keep_out_mask
    yield from _refused("", lambda: mask_polygons(mask) if mask.startswith(INLINE) else None)
    if config.mission.keep_out_topic and mask and not mask.startswith(INLINE):
        yield BadConfiguration(
            f"mission.keep_out_mask must be left out beside mission.keep_out_topic, got {mask!r}"
        )


def _fleet_misfits(fleet: FleetConfig) -> Iterator[BadConfiguration]:
    if not fleet.frame and (fleet.x_m or fleet.y_m or fleet.yaw_deg):
        yield BadConfiguration(
            "fleet.frame: expected the name of the frame that fleet.x_m, fleet.y_m and "
            "fleet.yaw_deg are given in"
        )
    if not fleet.frame and fleet.map_frame:
        yield BadConfiguration(
            "fleet.map_frame: expected fleet.frame beside it, the name of the frame in which "
            "that map has a place"
        )


def _ros_misfits(config: DaemonConfig, ros: RosConfig) -> Iterator[BadConfiguration]:
    for error in ros.faults():
        yield BadConfiguration(f"ros2.{error}")
    if ros.dock == "nav2" and not config.mission.dock:
        yield BadConfiguration("mission.dock must be given where ros2.dock is nav2, got null")


def _refused(before: str, make: Callable[[], object]) -> Iterator[BadConfiguration]:
    """Yield why ``make`` refuses a value, if it does."""
    try:
        make()
    except BadConfiguration as error:
        yield BadConfiguration(before + str(error), hint=error.hint)
