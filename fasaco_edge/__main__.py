"""The program: ``fasaco-edge``, or ``python -m fasaco_edge``."""

import sys
from typing import NoReturn


def program() -> NoReturn:
    """Run the command line; Ctrl-C during its import ends it as at any other time."""
    try:
        from fasaco_edge.cli import program as run  # noqa: PLC0415

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    program()
