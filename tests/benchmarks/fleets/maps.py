"""Generated buildings as maps, for real daemons.

python -m tests.benchmarks.fleets.maps DIR --generated 3 --cells 1000
fasaco-edge demo --map DIR/building0.yaml --robots 4 --robot-radius 0.135
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from fasaco_edge.grid.geometry import Pose2D
from maps.map_writer import write_map
from tests.benchmarks.buildings import building
from tests.benchmarks.fleets.run import TOOL_M
from tests.benchmarks.online.buildings import of_grid


def main() -> None:
    """Write the maps."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--generated", type=int, default=3, metavar="N", help="(default: 3)")
    parser.add_argument("--cells", type=int, default=1_000, help="of each (default: 1000)")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    for seed in range(args.generated):
        made = of_grid(building(args.cells, seed), TOOL_M)
        # The simulated robot starts at the origin.
        y, x = ((at + 0.5) * TOOL_M for at in made.start)
        geometry = replace(made.truth.geometry, origin=Pose2D(-x, -y))
        file = args.folder / f"building{seed}.yaml"
        write_map(replace(made.truth, geometry=geometry), file)
        print(file)


if __name__ == "__main__":
    main()
