"""Where the files that come with the package lie: the maps and the protocol.

In a source checkout they are beside the package; a wheel carries them inside
it, in ``_share``.
"""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def folder(name: str, package: Path = PACKAGE) -> Path:
    """Return the folder ``name`` ("maps" or "protocol") that came with the package.

    Args:
        name: name of the folder at the top of the source tree.
        package: folder of the installed package.

    Raises:
        FileNotFoundError: this installation has no such folder.
    """
    # Beside an installed package lie other packages: a site-packages/maps would belong to another
    # package. Only a checkout has the project file there.
    is_checkout = (package.parent / "pyproject.toml").is_file()
    beside, inside = package.parent / name, package / "_share" / name
    for found in [beside, inside] if is_checkout else [inside]:
        if found.is_dir():
            return found
    raise FileNotFoundError(
        f"this installation has no folder {name!r}: neither {beside} nor {inside}"
    )
