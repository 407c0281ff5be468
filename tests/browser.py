"""Pages in a real browser: what a script finds there, mistakes on the console, words written over others."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

OVERLAPS = Path(__file__).with_name("overlaps.js")
_WATCH = """<script>
const errors = [];
window.onerror = (message) => { errors.push(String(message)); };
console.error = (...words) => { errors.push(words.join(" ")); };
window.addEventListener("unhandledrejection", (event) => { errors.push(String(event.reason)); });
</script>"""


def look(page: Path, script: str, folder: Path, size: tuple[int, int] = (1300, 1000)) -> dict[str, Any]:
    """What the script has put into `seen`, with `errors` and `overlaps`. script: runs when the page is ready."""
    assert BROWSER is not None
    probe = f"<script>const seen = {{}};{OVERLAPS.read_text()}{script}\n"
    probe += "seen.errors = errors; seen.overlaps = overlaps();"
    probe += 'document.title = "seen" + JSON.stringify(seen);</script>'
    copy = folder / "probed.html"
    copy.write_text(page.read_text().replace("<head>", f"<head>{_WATCH}").replace("</body>", f"{probe}</body>"))
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", f"--window-size={size[0]},{size[1]}",
        f"--user-data-dir={folder / 'profile'}", "--dump-dom", copy.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    told = re.search(r"<title>seen(.*?)</title>", done.stdout, re.DOTALL)
    assert told is not None, done.stdout[:2000] + done.stderr[-2000:]
    found: dict[str, Any] = json.loads(told[1])
    return found
