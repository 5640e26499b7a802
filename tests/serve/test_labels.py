"""Names of areas on the page's map, drawn by its functions in Node.js."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from importlib import resources

import pytest

NODE = shutil.which("node")
# A context whose letters are 8 pixels wide, on a map of 20 pixels a metre.
STAGE = """
const colours = {}, canvas = { clientWidth: 390 }, shown = [];
const toScreen = (x, y) => [20 * x, -20 * y], trace = () => {};
const context = new Proxy({
  measureText: (text) => ({ width: 8 * text.length }), fillText: (text) => shown.push(text),
}, { get: (own, name) => own[name] || (() => {}), set: () => true });
const square = (wide) => [[0, 0], [wide, 0], [wide, wide], [0, wide]];
let picked = "";
"""


def function_of(file: str, name: str) -> str:
    """Return the text of a function of the page."""
    text = (resources.files("fasaco_edge.serve") / "page" / file).read_text()
    found = re.search(rf"^function {name}\(.*?^}}$", text, re.DOTALL | re.MULTILINE)
    assert found, name
    return found[0]


@pytest.mark.skipif(NODE is None, reason="needs Node.js")
def test_a_small_keep_out_has_its_name_once_it_is_picked():
    parts = [function_of("picture.js", name) for name in ("drawArea", "drawLabel")]
    parts += [function_of("rooms.js", name) for name in ("whole", "fitting")]
    areas = [("small", 0.4), ("a long name", 3.0), ("large", 3.0)]
    draw = "".join(
        f"drawArea(context, square({wide_m}), '', {name!r}, false);" for name, wide_m in areas
    )
    said = "console.log(JSON.stringify(shown));"
    script = "\n".join(
        [STAGE, 'const LABEL_FONT = "";', *parts, draw, "picked = 'small';", draw, said]
    )
    assert NODE is not None
    ran = subprocess.run([NODE, "-e", script], capture_output=True, text=True, check=True)
    assert json.loads(ran.stdout) == ["a long n…", "large", "small", "a long n…", "large"]
