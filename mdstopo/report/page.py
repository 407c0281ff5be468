"""The page itself: template, style and script from the files beside this one, and the data in it."""

import json
from html import escape
from importlib.resources import files
from typing import Any


def page(data: dict[str, Any]) -> str:
    """HTML that needs nothing else."""
    folder = files("mdstopo.report")
    style, script, body = ((folder / name).read_text(encoding="utf-8") for name in ("page.css", "page.js", "page.html"))
    # "</script" in a case file must not end the script
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return (
        body.replace("{title}", escape(str(data["title"])))
        .replace("{style}", style)
        .replace("{data}", text)
        .replace("{script}", script)
    )
