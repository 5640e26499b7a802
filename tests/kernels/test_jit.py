"""The compiler's settings: numba's own, and nobody else's."""

import subprocess
import sys
from pathlib import Path

from tests.daemon.processes import ENVIRONMENT

LOOK = """\
import yaml, warnings
warnings.simplefilter("error")
from fasaco_edge.kernels.jit import kernel, numba
assert yaml.safe_load("a: 1")
import sys
assert sys.modules["yaml"] is yaml
numba.core.config.reload_config()
print(numba.config.DISABLE_JIT, int(numba.config.OPT))
"""


def test_a_file_in_the_working_folder_does_not_set_up_the_compiler(tmp_path: Path):
    (tmp_path / ".numba_config.yaml").write_text("disable_jit: 1\nopt: 0\n")
    words = [sys.executable, "-P", "-c", LOOK]
    done = subprocess.run(
        words, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.stdout == "0 3\n", done.stderr
