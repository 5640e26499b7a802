"""Reading of configurations: keys of earlier releases, credentials, and checks that raise."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from fasaco_edge.errors import BadConfiguration, nested_key

FOLDER = "CREDENTIALS_DIRECTORY"
_DOCKING = (
    "was removed in this version, `fasaco-edge follow` no longer commands Nav2's docking server",
    "delete the key; the base docks by itself, or on command of a program of your own that reads "
    "the state `charging`",
)
# Removed keys of earlier releases: why, and what to do. A removed key without a value is ignored,
# as copies of old examples contain it.
REMOVED = {
    "planner.own": (
        "was removed in this version, the daemon plans with its own planners only",
        "delete the key; `fasaco-edge plan --planner MODULE:NAME` runs a planner of your own",
    ),
    "planner.local_search": (
        "was removed in this version, each planner has a name of its own",
        "for true write name: colony-search, or leave the name out; for false write name: fasaco; "
        "with another name delete the key",
    ),
    "ros2.dock": _DOCKING,
    "ros2.nav2.dock_action": _DOCKING,
    "ros2.nav2.undock_action": _DOCKING,
    "ros2.nav2.dock_id": _DOCKING,
    "ros2.nav2.dock_type": _DOCKING,
}


def faults_of(
    check: Callable[[], object], *, key: str = "", others: Sequence[str] = ()
) -> Iterator[BadConfiguration]:
    """Yield the error that a check raises, with ``key`` as its key unless that is ""."""
    try:
        check()
    except BadConfiguration as error:
        error.key, error.others = key or error.key, (*error.others, *others)
        yield error


def without_removed(document: object, key: str = "") -> tuple[Any, list[BadConfiguration]]:
    """Return a section ``key`` without removed keys, and a fault for each that has a value."""
    kept: dict[str, object] = {}
    faults: list[BadConfiguration] = []
    if not isinstance(document, Mapping):
        return document, faults
    for name, value in document.items():
        path = nested_key(key, str(name))
        if path in REMOVED:
            what, hint = REMOVED[path]
            if value not in (None, ""):
                faults.append(BadConfiguration(what, hint=hint, key=path))
        else:
            kept[name], found = without_removed(value, path)
            faults += found
    return kept, faults


def renamed(config: Mapping[str, object]) -> dict[str, object]:
    """Return a recorded configuration with this release's name of the planner.

    Earlier releases called colony-search "fasaco", with ``planner.local_search`` true.
    """
    planner = config.get("planner")
    if not isinstance(planner, Mapping) or "local_search" not in planner:
        return dict(config)
    planner = dict(planner)
    if planner.pop("local_search") and planner.get("name") == "fasaco":
        planner["name"] = "colony-search"
    return {**config, "planner": planner}


def with_credentials(part: object, environ: Mapping[str, str] = os.environ) -> object:
    """Return a part of a configuration with ``$CREDENTIALS_DIRECTORY/`` resolved.

    A service manager passes files in a folder of its own for each service (LoadCredential= in
    systemd.exec(5)). Without that folder the text stays, so that the file is reported missing.
    """
    folder = environ.get(FOLDER)
    if folder is None:
        return part
    if isinstance(part, dict):
        return {key: with_credentials(value, environ) for key, value in part.items()}
    if isinstance(part, str) and part.startswith(f"${FOLDER}/"):
        return folder + part.removeprefix(f"${FOLDER}")
    return part
