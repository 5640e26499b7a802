"""Release folders of this checkout without a network: what it needs is linked, not copied.

Each dependency's wheel is an empty one of the right name and version; one wheel holds a path
configuration file that points to where a lab shows this machine's packages. Our own wheel is whole.
"""

from __future__ import annotations

import ensurepip
import platform
import sys
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

from pip._vendor.packaging.requirements import Requirement
from pip._vendor.packaging.utils import canonicalize_name

from fasaco_edge import __version__
from tests.deploy.installed import CHECKOUT, LIBRARIES
from tests.deploy.wheels import write_wheel
from wheelhouse.closure import Target
from wheelhouse.release import fill_release

SHOWN = "/srv/packages"
THIS = Target(platform.machine(), f"{sys.version_info.major}.{sys.version_info.minor}")
SHARED = ("maps", "protocol")


def binds() -> dict[str, Path]:
    """Return what a lab has to show for these releases to work in it."""
    return {f"{SHOWN}/{number}": path for number, path in enumerate(LIBRARIES)}


def write_release(
    folder: Path,
    version: str,
    changed: Mapping[str, str] | None = None,
    *,
    target: Target | None = None,
) -> Path:
    """Write a release folder with recording.

    Args:
        folder: an empty one.
        version: the version it calls itself.
        changed: other texts for some of the package's files, by their path in the checkout.
        target: the computer it says it is for (default: this one).
    """
    needs = [*_required(), "linked"]
    wheels = folder / "wheels-made"
    write_wheel(
        wheels,
        "fasaco_edge",
        version,
        needs=needs,
        commands=["fasaco-edge=fasaco_edge.cli:main"],
        files=_package(version, changed or {}),
    )
    for name, there in _closure(needs).items():
        write_wheel(wheels, name.replace("-", "_"), there)
    paths = "".join(f"{place}\n" for place in binds())
    write_wheel(wheels, "linked", "1.0", files={"linked.pth": paths.encode()})
    release = folder / f"fasaco-edge-{version}"
    fill_release(release, wheels, bundled_pip(), target or THIS, recording=True)
    for made in (folder, release):
        made.chmod(0o755)
    return release


def bundled_pip() -> Path:
    """Return the wheel of pip that Python brings along for new environments."""
    folders = Path(ensurepip.__file__).with_name("_bundled"), Path("/usr/share/python-wheels")
    return next(wheel for folder in folders for wheel in folder.glob("pip-*.whl"))


def _required() -> list[str]:
    return [
        one
        for one in metadata.requires("fasaco-edge") or ()
        if "extra ==" not in one or "extra == 'record'" in one
    ]


def _closure(needs: list[str]) -> dict[str, str]:
    """Return name and version of all that is needed, as it is installed here."""
    found: dict[str, str] = {}
    waiting = [need for need in needs if need != "linked"]
    while waiting:
        requirement = Requirement(waiting.pop())
        name = canonicalize_name(requirement.name)
        marker = requirement.marker
        if name in found or (marker and not marker.evaluate({"extra": "record"})):
            continue
        found[name] = metadata.version(name)
        waiting += [one for one in metadata.requires(name) or () if "extra ==" not in one]
    return found


def _package(version: str, changed: Mapping[str, str]) -> dict[str, bytes]:
    own = _files(CHECKOUT / "fasaco_edge", "fasaco_edge")
    for name in SHARED:
        own |= _files(CHECKOUT / name, f"fasaco_edge/_share/{name}")
    first = own["fasaco_edge/__init__.py"]
    assert __version__.encode() in first
    own["fasaco_edge/__init__.py"] = first.replace(__version__.encode(), version.encode())
    return own | {path: text.encode() for path, text in changed.items()}


def _files(folder: Path, place: str) -> dict[str, bytes]:
    return {
        f"{place}/{file.relative_to(folder)}": file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file() and "__pycache__" not in file.parts
    }
