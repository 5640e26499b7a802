"""What a folder of wheels holds, and whether all that they need is among it."""

from __future__ import annotations

import email
import hashlib
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from email.message import Message
from pathlib import Path

# pip brings it along: this has to run where nothing but Python with venv is.
from pip._vendor.packaging.requirements import Requirement
from pip._vendor.packaging.utils import canonicalize_name

OWN = "fasaco-edge"
# What byte-compiling adds to a wheel's Python files: measured, 1.3 times their own size.
BYTE_CODE = 1.3


class IncompleteError(Exception):
    """Something that is needed is not in the folder."""


@dataclass(frozen=True, slots=True)
class Target:
    """The computer that is installed on.

    Attributes:
        machine: ``uname -m`` there.
        python: its Python, ``3.11``.
    """

    machine: str
    python: str

    @property
    def name(self) -> str:
        """As it stands in the name of a folder."""
        return f"{self.machine}-py{self.python.replace('.', '')}"

    def markers(self, extra: str) -> dict[str, str]:
        """Return what requirements may ask for: the target's answers, not this computer's."""
        return {
            "implementation_name": "cpython",
            "implementation_version": f"{self.python}.0",
            "os_name": "posix",
            "platform_machine": self.machine,
            "platform_python_implementation": "CPython",
            "platform_system": "Linux",
            "python_full_version": f"{self.python}.0",
            "python_version": self.python,
            "sys_platform": "linux",
            "extra": extra,
        }


@dataclass(frozen=True, slots=True)
class Closure:
    """Wheels that need nothing but each other.

    Attributes:
        files: of each project its wheel.
        versions: of each project its version.
    """

    files: dict[str, Path]
    versions: dict[str, str]

    @property
    def version(self) -> str:
        """Our own."""
        return self.versions[OWN]

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of each wheel, by project."""
        return {
            name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in self.files.items()
        }


def closure_of(wheels: Path, target: Target, extras: Sequence[str]) -> Closure:
    """Return our wheel in the folder, and all that it needs with these extras.

    Raises:
        IncompleteError: one is missing, is there twice, or is of a version that does not do.
    """
    there = _wheels_of(wheels)
    files: dict[str, Path] = {}
    versions: dict[str, str] = {}
    needed = [(Requirement(f"{OWN}[{','.join(extras)}]" if extras else OWN), "this folder")]
    while needed:
        requirement, by = needed.pop()
        name = canonicalize_name(requirement.name)
        if name not in there:
            raise IncompleteError(f"{by} needs {requirement}: no wheel of it in {wheels}")
        file, metadata = there[name]
        if not requirement.specifier.contains(metadata["Version"], prereleases=True):
            raise IncompleteError(f"{by} needs {requirement}, there is {file.name}")
        if name in files and not requirement.extras:
            continue
        files[name], versions[name] = file, metadata["Version"]
        needed += [(one, name) for one in _needs(metadata, target, requirement.extras)]
    return Closure(files, versions)


def installed_mb(files: Iterable[Path]) -> int:
    """Return what the wheels take once they are installed and byte-compiled [MB]."""
    total = 0.0
    for file in files:
        with zipfile.ZipFile(file) as wheel:
            for member in wheel.infolist():
                code = BYTE_CODE if member.filename.endswith(".py") else 0.0
                total += member.file_size * (1.0 + code)
    return round(total / 1e6)


def _needs(metadata: Message, target: Target, extras: Iterable[str]) -> list[Requirement]:
    environments = [target.markers(extra) for extra in ("", *extras)]
    requirements = map(Requirement, metadata.get_all("Requires-Dist") or ())
    return [
        one
        for one in requirements
        if one.marker is None or any(one.marker.evaluate(env) for env in environments)
    ]


def _wheels_of(folder: Path) -> dict[str, tuple[Path, Message]]:
    found: dict[str, tuple[Path, Message]] = {}
    for file in sorted(folder.glob("*.whl")):
        with zipfile.ZipFile(file) as wheel:
            member = next(name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
            metadata = email.message_from_bytes(wheel.read(member))
        name = canonicalize_name(metadata["Name"])
        if name in found:
            raise IncompleteError(f"two wheels of {name}: {found[name][0].name}, {file.name}")
        found[name] = file, metadata
    return found
