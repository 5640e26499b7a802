"""Folders of files that come with the package: the maps and the protocol.

In a source checkout they are beside the package; in a wheel inside it, in ``_share``.
"""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def folder(name: str, package: Path = PACKAGE) -> Path:
    """Return a folder that came with the package: "maps" or "protocol".

    Raises:
        FileNotFoundError: this installation has no such folder.
    """
    # Only a checkout has the project file beside the package. Beside an installed package are other
    # packages, which may have the same names.
    is_checkout = (package.parent / "pyproject.toml").is_file()
    beside, inside = package.parent / name, package / "_share" / name
    for found in [beside, inside] if is_checkout else [inside]:
        if found.is_dir():
            return found
    raise FileNotFoundError(
        f"this installation has no folder {name!r}: neither {beside} nor {inside}"
    )
