"""Writes protocol/vectors: ``python -m tests.wire.make_vectors``, from the top folder.

A test holds the files to what this module makes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fasaco_edge.host.resources import folder
from tests.wire.hostile_vectors import hostile_vectors
from tests.wire.valid_vectors import valid_vectors


def files() -> dict[str, bytes]:
    """Return every file below protocol/vectors, by its name there."""
    made = {}
    for kind, vectors in (("valid", valid_vectors()), ("hostile", hostile_vectors())):
        index = []
        for vector in vectors:
            made[f"{kind}/{vector.name}.bin"] = vector.payload
            index.append({"file": f"{vector.name}.bin", "schema": vector.schema, **vector.facts})
        made[f"{kind}/index.yaml"] = _index_text(index)
    return made


def _index_text(index: list[dict[str, Any]]) -> bytes:
    """Return YAML with a line for every fact, and no references between vectors."""
    lines = []
    for entry in index:
        for position, (name, value) in enumerate(entry.items()):
            text = json.dumps(value, ensure_ascii=False)
            lines.append(f"{'  ' if position else '- '}{name}: {text}\n")
    return "".join(lines).encode()


def write(into: Path) -> None:
    """Write all files below ``into``."""
    for name, content in files().items():
        (into / name).parent.mkdir(parents=True, exist_ok=True)
        (into / name).write_bytes(content)


if __name__ == "__main__":
    write(folder("protocol") / "vectors")
