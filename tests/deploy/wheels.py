"""Wheels made by hand: a wheel is a zip with a few texts, so none has to be fetched."""

from __future__ import annotations

import base64
import hashlib
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path


def write_wheel(
    folder: Path,
    name: str,
    version: str,
    *,
    needs: Sequence[str] = (),
    commands: Sequence[str] = (),
    files: Mapping[str, bytes] | None = None,
) -> Path:
    """Write a wheel for any computer.

    Args:
        folder: where to.
        name: the project's, with "_" for "-".
        version: its version.
        needs: its requirements.
        commands: its entry points, ``name=module:function``.
        files: its content by path.
    """
    info = f"{name}-{version}.dist-info"
    texts = dict(files or {})
    metadata = ["Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}"]
    metadata += [f"Requires-Dist: {need}" for need in needs]
    if any("extra ==" in need for need in needs):
        metadata.append("Provides-Extra: record")
    texts[f"{info}/METADATA"] = ("\n".join(metadata) + "\n").encode()
    texts[f"{info}/WHEEL"] = b"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    if commands:
        texts[f"{info}/entry_points.txt"] = "\n".join(["[console_scripts]", *commands]).encode()
    record = [f"{path},{_digest(content)},{len(content)}" for path, content in texts.items()]
    texts[f"{info}/RECORD"] = "\n".join([*record, f"{info}/RECORD,,", ""]).encode()
    folder.mkdir(parents=True, exist_ok=True)
    wheel = folder / f"{name}-{version}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as out:
        for path, content in texts.items():
            out.writestr(path, content)
    return wheel


def _digest(content: bytes) -> str:
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest())
    return f"sha256={digest.rstrip(b'=').decode()}"
