"""The page itself: template, style and script from the files beside this one, and the data in it."""

import json
import re
from html import escape
from importlib.resources import files
from typing import Any


def page(data: dict[str, Any]) -> str:
    """The page of a report as one HTML file, which needs nothing else."""
    folder = files("mdstopo.report")
    scene = "scene_space.js" if data["dimension"] > 2 else "scene_plane.js"
    names = ("page.css", "glyphs.js", "members.js", scene, "page.js", "page.html")
    style, *scripts, body = ((folder / name).read_text(encoding="utf-8") for name in names)
    # neither "</script" nor "<!--<script" in a case file may mean anything to the page
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    parts = {"title": escape(str(data["title"])), "style": style, "data": text, "script": "".join(scripts)}
    return re.sub(r"\{(title|style|data|script)\}", lambda found: parts[found[1]], body)
