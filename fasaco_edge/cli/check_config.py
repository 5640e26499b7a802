"""``fasaco-edge check-config``: a list of all faults in a configuration."""

from __future__ import annotations

import argparse
from pathlib import Path

from fasaco_edge.cli.console.arguments import Exit, Subcommand, add_json
from fasaco_edge.cli.console.streams import print_json
from fasaco_edge.cli.console.terminal import out, say
from fasaco_edge.config.cautions import cautions
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import inspect_config, with_mask
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.plain_yaml import dump
from fasaco_edge.host.processes import memory_limit

EPILOG = """\
It reads the file and its keep-out mask as the daemon does, and starts nothing. It does not read
keys and passwords, which may be readable for the service only; `fasaco-edge doctor`, run as the
service's user, checks those.

exit codes: 0 a daemon starts with this file, 78 it does not (EX_CONFIG)

examples:
  fasaco-edge check-config /etc/fasaco-edge/config.yaml
  fasaco-edge check-config robot.yaml --show    # with defaults filled in
  fasaco-edge check-config robot.yaml --json | jq -r '.faults[] | "\\(.line): \\(.said)"'
"""


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="YAML configuration")
    parser.add_argument(
        "--show",
        action="store_true",
        help="print the whole configuration with defaults, but without secrets, as YAML",
    )
    add_json(parser, "the result")


def _shown(config: DaemonConfig) -> dict[str, object]:
    # This imports most of the daemon.
    from fasaco_edge.daemon.loop.answers import config_document

    return config_document(config)


def run(args: argparse.Namespace) -> int:
    """Check the configuration, and print the result."""
    from fasaco_edge.daemon.memory import mask_bytes

    def read_mask(config: DaemonConfig) -> None:
        with_mask(config, args.file, mask_bytes(config, memory_limit()))

    config, faults = inspect_config(args.file, read_mask)
    if args.json:
        print_json(_document(args, config, faults))
    elif config is None:
        _print(args.file, faults)
    elif args.show:
        print(dump(_shown(config)), end="")
    else:
        print(f"{args.file}: in order")
        for remark in filter(None, (config.robot.assumed, *cautions(config))):
            say(out(), remark, "  ", "  ")
    return Exit.OK if config is not None else Exit.CONFIG


def _document(
    args: argparse.Namespace, config: DaemonConfig | None, faults: list[BadConfiguration]
) -> dict[str, object]:
    document: dict[str, object] = {
        "file": str(args.file),
        "ok": config is not None,
        "faults": [
            {
                "key": fault.key,
                "line": fault.line,
                "code": fault.code,
                "said": fault.said,
                "hint": fault.hint,
            }
            for fault in faults
        ],
        "cautions": cautions(config) if config is not None else [],
    }
    if args.show:
        document["config"] = _shown(config) if config is not None else None
    return document


def _print(file: Path, faults: list[BadConfiguration]) -> None:
    """Print each fault as ``file:line: text``, and its hint, except the general hint."""
    console = out()
    for fault in faults:
        where = f"{file}:{fault.line}" if fault.line else str(file)
        say(console, f"{where}: {fault.said}", below="  ")
        if fault.hint != BadConfiguration.hint:
            say(console, fault.hint, "  -> ", "     ")


COMMAND = Subcommand(
    description="Check a configuration before a daemon starts with it; list every fault with its "
    "line, the value, and what is allowed.",
    run=run,
    add_options=_add_options,
    epilog=EPILOG,
)
