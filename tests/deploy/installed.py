"""This checkout as a service finds it installed, at /opt/fasaco-edge/current.

A service with DynamicUser= sees neither home folders nor /tmp, where a checkout and its virtual
environment often lie; so both are shown to it elsewhere, and run by the system's own Python.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from fasaco_edge.kernels.manifest import chosen_folder
from fasaco_edge.planners.compiling import compile_missing
from fasaco_edge.planners.stages import STAGES
from tests.deploy.lab import Lab

HOME = "/opt/fasaco-edge"
PYTHON = Path("/usr/bin/python3")
CHECKOUT = Path(__file__).parents[2]
LIBRARIES = [path for path in map(Path, sys.path) if path.name == "site-packages"]
PACKAGES = f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"
SOURCE = f"{HOME}/source"
SCRIPT = f"""\
#!{HOME}/current/bin/python3 -I
from fasaco_edge.__main__ import program
program()
"""


def why_not() -> str:
    """Return why the system's Python cannot run what is installed here, "" if it can."""
    if not PYTHON.exists():
        return f"there is no {PYTHON}"
    tell = [str(PYTHON), "-c", "import sys; print(*sys.version_info[:2], sep='.')"]
    there = subprocess.run(tell, capture_output=True, text=True, check=True).stdout.strip()
    here = f"{sys.version_info.major}.{sys.version_info.minor}"
    return "" if there == here else f"{PYTHON} is {there}, the packages here are for {here}"


def binds(folder: Path) -> dict[str, Path]:
    """Return what a lab has to show for this to be installed in it; ``folder`` is an empty one."""
    # An installer compiles the sources to byte code; nobody can inside, where they are read-only.
    subprocess.run([sys.executable, "-m", "compileall", "-q", CHECKOUT / "fasaco_edge"], check=True)
    shown = {SOURCE: CHECKOUT}
    shown |= {f"{HOME}/packages/{number}": path for number, path in enumerate(LIBRARIES)}
    current = folder / "current"
    (current / "bin").mkdir(parents=True)
    (current / PACKAGES).mkdir(parents=True)
    (current / "pyvenv.cfg").write_text("home = /usr/bin\ninclude-system-site-packages = false\n")
    (current / "bin/python3").symlink_to(PYTHON)
    (current / PACKAGES / "shown.pth").write_text("\n".join(shown) + "\n")
    script = current / "bin/fasaco-edge"
    script.write_text(SCRIPT)
    script.chmod(0o755)
    # As for any service; pytest makes its folders for its own user alone.
    folder.chmod(0o755)
    return shown | {f"{HOME}/current": current}


def warm(lab: Lab) -> None:
    """Give the service, and root, the kernels that were compiled for this checkout: all of them."""
    compile_missing()
    here, _ = chosen_folder(STAGES)
    assert here is not None
    # The folder's name tells the patch level of Python, of which the code in it is independent.
    tell = "from fasaco_edge.kernels.folder import code_digest; print(f'kernels-{code_digest()}')"
    path = ":".join(map(str, (CHECKOUT, *LIBRARIES)))
    told = subprocess.run(
        [str(PYTHON), "-c", tell],
        env={"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    # Root runs robots and asks questions.
    roots = Path("~root").expanduser() / ".cache/fasaco-edge"
    for home in ("/var/cache/fasaco-edge/numba", str(roots)):
        place = lab.root / home.lstrip("/") / told.stdout.strip()
        shutil.copytree(here, place, dirs_exist_ok=True)
