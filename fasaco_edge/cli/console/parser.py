"""A parser of command lines whose errors suggest what was probably meant."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NoReturn

from fasaco_edge.cli.console.help import HelpText
from fasaco_edge.text import suggestion

USAGE = 2
"""Exit code of a wrong command line."""
UNITS = {"M": "metres", "S": "seconds", "MIN": "minutes", "MB": "megabytes", "HZ": "hertz"}
"""Units of options by their metavar."""
_AFTER_COMMAND = "options such as {} come after the command"


class Parser(argparse.ArgumentParser):
    """Parses a command line; the parsers of commands have this class, too."""

    def __init__(self, **options: Any) -> None:  # noqa: ANN401 - those of argparse
        super().__init__(**{"formatter_class": HelpText} | options)
        # A value such as -1,2 is a position, not an option.
        self._negative_number_matcher = re.compile(r"-\.?\d")
        self._given: Sequence[str] = ()

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Return the arguments, with the innermost command's ``parser``; and unknown words."""
        self._given = sys.argv[1:] if args is None else args
        found, unknown = super().parse_known_args(args, namespace)
        if not hasattr(found, "parser"):
            found.parser = self
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """Print an error, and exit; a misspelt option is reported before a missing argument."""
        lacks_command = message.endswith("required: COMMAND")
        if "arguments are required" in message:
            options = tuple(self._option_string_actions)
            for word in self._given:
                name = word.partition("=")[0]
                is_known = any(each.startswith(name) for each in options)
                # An unknown option may be one of the missing command.
                is_misspelt = not lacks_command or suggestion(name, options)
                if name.startswith("--") and not is_known and is_misspelt:
                    self._given = ()
                    self.refuse([name])
        if lacks_command:
            groups = [each for each in self._actions if isinstance(each.choices, dict)]
            message = f"a command is missing; there are {', '.join(groups[0].choices or ())}"
        print(f"{self.prog}: {message}\nsee: {self.prog} --help", file=sys.stderr)
        sys.exit(USAGE)

    def refuse(self, unknown: Sequence[str]) -> NoReturn:
        """Print the unknown arguments and a suggestion, and exit."""
        options = [name for name in self._option_string_actions if name.startswith("--")]
        names = [word.partition("=")[0] for word in unknown if word.startswith("-")]
        if names and names[0] in options:
            meant = _AFTER_COMMAND.format(names[0])
        elif names:
            meant = suggestion(names[0], options)
        else:
            files = [name for name in ("--order", "--config") if name in options]
            is_file = unknown[0].endswith((".yaml", ".yml"))
            meant = f"did you mean {files[0]} {unknown[0]}?" if files and is_file else ""
        self.error(f"unrecognized arguments: {' '.join(unknown)}{meant and f'; {meant}'}")

    def typed(self, dest: str) -> str:
        """Return the option that sets ``dest``: as it was typed, else its first name."""
        actions = self._option_string_actions.items()
        names = [name for name, action in actions if action.dest == dest]
        typed = (word.partition("=")[0] for word in self._given)
        return next((name for name in typed if name in names), names[0])

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:  # noqa: ANN401
        try:
            return super()._get_value(action, arg_string)
        except argparse.ArgumentError as error:
            if number := re.match(r"invalid (\w+) value: ", error.message):
                kind = "a number" if number[1] == "float" else "a whole number"
                unit = f" of {UNITS[action.metavar]}" if action.metavar in UNITS else ""
                error.message = f"must be {kind}{unit}, got {arg_string!r}"
            if re.fullmatch(r"-?\d*,\d+", arg_string):
                point = arg_string.replace(",", ".")
                # No suggestion if a number with a point is wrong, too.
                with suppress(argparse.ArgumentError):
                    super()._get_value(action, point)
                    error.message += f"; did you mean {point}?"
            raise

    def _check_value(self, action: argparse.Action, value: Any) -> None:  # noqa: ANN401
        if action.choices is None or value in action.choices:
            return
        names = [str(choice) for choice in action.choices]
        meant = suggestion(value, names) if isinstance(value, str) else ""
        if not meant and isinstance(action, argparse._SubParsersAction) and value in self._given:
            before = self._given[max(self._given.index(value) - 1, 0)]
            if before.startswith("-"):
                meant = _AFTER_COMMAND.format(before)
        meant = meant or f"there are {', '.join(names)}"
        raise argparse.ArgumentError(action, f"invalid choice: {value!r}; {meant}")
