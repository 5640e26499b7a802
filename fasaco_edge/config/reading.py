"""Reading of configurations: keys of earlier releases, credentials, and checks that raise."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence

from fasaco_edge.errors import BadConfiguration, joined

FOLDER = "CREDENTIALS_DIRECTORY"
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
}


def refused(
    check: Callable[[], object], *, key: str = "", others: Sequence[str] = ()
) -> Iterator[BadConfiguration]:
    """Yield the error that a check raises, at ``key``, or else where it says itself."""
    try:
        check()
    except BadConfiguration as error:
        error.key, error.others = key or error.key, tuple(others)
        yield error


def removed_faults(document: object, key: str = "") -> Iterator[BadConfiguration]:
    """Yield the keys of earlier releases that a document gives a value."""
    for name, value in document.items() if isinstance(document, dict) else ():
        path = joined(key, str(name))
        if path not in REMOVED:
            yield from removed_faults(value, path)
        elif value not in (None, ""):
            what, hint = REMOVED[path]
            yield BadConfiguration(what, hint=hint, key=path)


def without_removed(document: Mapping[str, object], key: str = "") -> dict[str, object]:
    """Return a section ``key`` of an earlier release without the keys removed since."""
    kept: dict[str, object] = {}
    for name, value in document.items():
        path = joined(key, str(name))
        if path not in REMOVED:
            kept[name] = without_removed(value, path) if isinstance(value, Mapping) else value
    return kept


def renamed(config: Mapping[str, object]) -> dict[str, object]:
    """Return a recorded configuration with this release's name of the planner.

    With ``planner.local_search``, fasaco was what is now colony-search.
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
