"""A page on this computer that follows a result file while it grows.

The file is only read: whoever writes it replaces it as a whole, so that a reader never sees half of it and never holds
it up. It is read again only where it has changed.
"""

from __future__ import annotations

import json
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from mdstopo.case.responses.response_units import unit_of_value
from mdstopo.plots.animation import still
from mdstopo.plots.source import Source
from mdstopo.report.fit_tables import fit_part
from mdstopo.store.json_values import json_value
from mdstopo.store.result_reader import ResultView
from mdstopo.store.store_errors import StoreError

HOST = "127.0.0.1"
#: rows that are sent, the last; points of a front that are sent
ROWS, POINTS = 2000, 5000
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'; img-src 'self'"
)


class Watched:
    """A result file, read again where it has changed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = Lock()
        self._stamp: tuple[int, int] | None = None
        self._state: dict[str, Any] = {}
        self._picture = ""

    def state(self) -> dict[str, Any]:
        """How far the run has come, as the page shows it."""
        with self._lock:
            self._refresh()
            return self._state

    def picture(self) -> str:
        """The design as SVG; empty where there is none yet."""
        with self._lock:
            self._refresh()
            return self._picture

    def _refresh(self) -> None:
        try:
            found = self.path.stat()
            stamp = (found.st_mtime_ns, found.st_ino)
        except OSError:
            self._stamp = None
            self._state, self._picture = {"waiting": f"there is no file {self.path.name} yet"}, ""
            return
        if stamp == self._stamp:
            return
        try:
            source = Source(self.path)
            state = state_of(source.view, source)
            picture = _drawn(source)
        except StoreError as error:  # another program's file, or one that is being replaced on a foreign file system
            self._state, self._picture = {"waiting": str(error)}, ""
            return
        self._stamp, self._state, self._picture = stamp, {**state, "stamp": str(stamp[0])}, picture


def _drawn(source: Source) -> str:
    try:
        return still(source)
    except StoreError:  # nothing to draw yet
        return ""


def state_of(view: ResultView, source: Source) -> dict[str, Any]:
    """The state of a result for the page: status, and the columns of iterations, points or runs."""
    objectives = {each.name: each for each in source.case.objectives}
    names = list(view.lines("objectives")) if "objectives" in view.texts else []
    state: dict[str, Any] = {
        "title": view.title or view.name,
        "kind": view.kind,
        "status": view.status.replace("_", " "),
        "reason": view.reason,
        "finished": view.finished,
        "objectives": [{"name": name, "unit": unit_of_value(objectives[name])} for name in names if name in objectives],
        "warnings": list(view.warnings),
    }
    arrays = view.arrays
    if view.kind == "fit":
        state["fit"] = fit_part(source, curves=False, rows=ROWS)
    if "iterations/combined" in arrays:
        state["iterations"] = _iterations(view)
    if "pareto/objectives" in arrays:
        status = list(view.lines("pareto/status"))
        visited = [part for path, part in view.under("pareto/visited").items()]
        cloud = np.concatenate(visited)[-POINTS:] if visited else np.zeros((0, len(names)))
        state["front"] = {
            "objectives": json_value(arrays["pareto/objectives"]),
            "status": status,
            "visited": json_value(cloud),
            "done": sum(word not in ("running", "", "waiting") for word in status),
        }
    if "sweep/objectives" in arrays:
        keys = list(view.lines("sweep/keys"))
        state["sweep"] = {
            "keys": keys,
            "values": [list(view.lines(f"sweep/values/{key}")) for key in keys],
            "objectives": json_value(arrays["sweep/objectives"]),
            "status": list(view.lines("sweep/status")),
        }
    return state


def _iterations(view: ResultView) -> dict[str, Any]:
    columns = view.under("iterations")
    total = len(columns["combined"])
    part = slice(max(0, total - ROWS), total)
    return {
        "first": part.start,
        "objectives": json_value(np.asarray(columns["objectives"])[part].T),
        "kkt": json_value(np.asarray(columns["kkt"])[part]) if "kkt" in columns else [],
        "seconds": json_value(np.asarray(columns["seconds"])[-1:]),
        "evaluations": int(columns["evaluations"][-1]) if total else 0,
    }


class _Handler(BaseHTTPRequestHandler):
    """Three addresses: the page, its state, its picture."""

    protocol_version = "HTTP/1.1"
    server_version, sys_version = "mdstopo", ""

    def __init__(self, watched: Watched, *given: Any) -> None:
        self._watched = watched
        super().__init__(*given)

    def do_GET(self) -> None:
        """Send one of the three pages; nothing where the request comes from a page of another site."""
        host = (self.headers.get("Host") or "").rpartition(":")[0] or self.headers.get("Host", "")
        if host not in (HOST, "localhost"):
            self._send(HTTPStatus.FORBIDDEN, "text/plain", f"ask for http://{HOST}")
        elif self.path == "/":
            page = (files("mdstopo.report") / "watch.html").read_text(encoding="utf-8")
            self._send(HTTPStatus.OK, "text/html", page)
        elif self.path == "/state":
            self._send(HTTPStatus.OK, "application/json", json.dumps(self._watched.state(), allow_nan=False))
        elif self.path.partition("?")[0] == "/picture":
            self._send(HTTPStatus.OK, "image/svg+xml", self._watched.picture())
        else:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "there is / only")

    def _send(self, status: HTTPStatus, kind: str, text: str) -> None:
        data = text.encode(errors="replace")
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", _POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, format: str, *given: Any) -> None:
        """Nothing is said of requests."""


def server(path: Path, port: int) -> ThreadingHTTPServer:
    """A server of the page, not yet serving. port: 0 takes a free one. Raises StoreError where the port is taken."""
    try:
        made = ThreadingHTTPServer((HOST, port), partial(_Handler, Watched(path)))
    except OSError as error:
        raise StoreError(f"port {port}: {error.strerror or error}; --port chooses another one") from error
    made.daemon_threads = True
    return made
