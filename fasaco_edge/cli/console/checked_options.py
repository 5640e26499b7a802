"""Options that set members of a configuration's section, and are checked as those are."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from fasaco_edge.errors import BadConfiguration, DocumentError
from fasaco_edge.host.documents import converted

if TYPE_CHECKING:
    from fasaco_edge.host.documents import StrictDocument


def given_members(args: argparse.Namespace, options: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of the given options by the members that they set."""
    values = {member: getattr(args, option) for option, member in options.items()}
    return {member: value for member, value in values.items() if value is not None}


def checked_members(
    section: type[StrictDocument], args: argparse.Namespace, options: Mapping[str, str]
) -> dict[str, Any]:
    """Return the members of a section that options set.

    Args:
        section: the section of the configuration.
        args: the parsed options.
        options: attributes of ``args``, and the members that they set.

    Raises:
        BadConfiguration: a value is impossible; the error names the option as it was typed.
    """
    members = given_members(args, options)
    with naming_options(args, {member: option for option, member in options.items()}):
        converted(section, members, BadConfiguration)
    return members


@contextmanager
def naming_options(args: argparse.Namespace, options: Mapping[str, str]) -> Iterator[None]:
    """Name options, as they were typed, in place of the keys in an error of the block.

    Args:
        args: the parsed options.
        options: keys, and the attributes of ``args`` from which their values are.

    Raises:
        DocumentError: the block raised it.
    """
    try:
        yield
    except DocumentError as error:
        for fault in (error, *error.rest):
            for key, option in options.items():
                if fault.key == key or fault.key.startswith((f"{key}.", f"{key}[")):
                    fault.key = args.parser.typed(option)
                    if fault.hint == type(fault).hint:
                        fault.advise(BadConfiguration.hint)
                    break
        raise
