"""The HTML page: one file, which loads nothing from other servers."""

from __future__ import annotations

import base64
import hashlib
from dataclasses import dataclass
from importlib.resources import files

# Files of the page's script, which are concatenated in this order.
SCRIPTS = (
    "model.js",
    "view.js",
    "picture.js",
    "drawing.js",
    "panel.js",
    "rooms.js",
    "orders.js",
    "timeline.js",
    "link.js",
)


@dataclass(frozen=True, slots=True)
class Page:
    """The page and its policy.

    Attributes:
        body: HTML with style and script.
        policy: Content-Security-Policy without connect-src.
    """

    body: bytes
    policy: str


def load_page() -> Page:
    """Return the page."""
    folder = files("fasaco_edge.serve").joinpath("page")
    style = folder.joinpath("style.css").read_text(encoding="utf-8")
    parts = (folder.joinpath(name).read_text(encoding="utf-8") for name in SCRIPTS)
    script = '"use strict";\n' + "\n".join(parts)
    html = folder.joinpath("page.html").read_text(encoding="utf-8")
    html = html.replace("/* style */", style).replace("/* script */", script)
    policy = (
        f"default-src 'none'; script-src '{_digest(script)}'; style-src '{_digest(style)}'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return Page(html.encode(), policy)


def _digest(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
