"""What is kept of a fit, as plain values for a JSON file: enough to draw it, to go on, and for other programs."""

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo._version import __version__
from mdstopo.case.arrays import FloatArray
from mdstopo.case.units import unit_of, words
from mdstopo.fit.problem import FitProblem
from mdstopo.fit.run_fit import FitRun
from mdstopo.store.atomic import replace_file
from mdstopo.store.same_case import describe
from mdstopo.store.store_errors import StoreError

#: what the files are, and their version
KIND = "mdstopo fit"
VERSION = 1


def content(run: FitRun) -> dict[str, Any]:
    """All of a run."""
    problem, case = run.problem, run.problem.case
    whole: dict[str, Any] = plain(
        {
            "kind": KIND,
            "version": VERSION,
            "program": __version__,
            "case": case.name,
            "title": case.title,
            "asked": asked(problem),
            "status": run.status,
            "reason": run.reason,
            "simulations": run.simulations,
            "loss": problem.fit.loss,
            "confidence": problem.fit.confidence,
            "estimates": [_estimate(run, i) for i in range(len(problem.names))],
            "correlation": None if run.statistics is None else run.statistics.correlation,
            "directions": None if run.statistics is None else [
                {"shares": each.shares, "change": each.change, "unknown": each.is_unknown}
                for each in run.statistics.directions
            ],
            "freedom": None if run.statistics is None else run.statistics.freedom,
            "chi_square": None if run.statistics is None else run.statistics.chi_square,
            "series": _series(run),
            "starts": [
                {
                    "begin": each.begin,
                    "x": each.x,
                    "deviations": _deviations(problem, each.deviation),
                    "level": each.level,
                    "status": each.status,
                    "reason": each.reason,
                    "evaluations": each.evaluations,
                }
                for each in run.starts
            ],
            "best": run.best if run.starts else None,
            "agreeing": run.agreeing if run.starts else 0,
        }
    )  # fmt: skip
    return whole


def asked(problem: FitProblem) -> str:
    """A digest of what was asked and measured: a run goes on only where it is the same."""
    digest = hashlib.sha256(describe(problem.case).encode())
    digest.update(repr(problem.fit).encode())
    for each in problem.measured:
        for array in (each.t, each.y, each.deviation):
            digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def write(run: FitRun, path: Path) -> None:
    """Put a run into its file, as a whole or not at all. Raises StoreError."""
    replace_file(path, (json.dumps(content(run), indent=1, allow_nan=False) + "\n").encode())


def read(path: Path) -> dict[str, Any]:
    """The content of a file. Raises StoreError where it is none of a fit."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise StoreError(f"{path}: this is no result of `mdstopo fit`: it is not JSON") from error
    if not isinstance(found, dict) or found.get("kind") != KIND:
        raise StoreError(f"{path}: this is no result of `mdstopo fit`")
    if found.get("version") != VERSION:
        raise StoreError(f"{path}: found version {found.get('version')}, this program reads {VERSION}")
    return found


def plain(value: Any) -> Any:
    """The same in what JSON has: arrays as lists, numbers that are not finite as null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


def _estimate(run: FitRun, i: int) -> dict[str, Any]:
    problem = run.problem
    estimate: dict[str, Any] = {
        "name": problem.names[i],
        "lower": problem.lower[i],
        "upper": problem.upper[i],
        "initial": problem.initial[i],
        "derivative": problem.derivatives[i],
    }
    if run.found is not None and run.statistics is not None:
        estimate |= {
            "value": run.found.x[i],
            "deviation": run.statistics.deviation[i],
            "low": run.statistics.low[i],
            "high": run.statistics.high[i],
            "at_bound": {-1: "lower", 1: "upper"}.get(int(run.statistics.at_bound[i])),
        }
    own = run.profiles.get(problem.names[i])
    if own is not None:
        estimate["profile"] = {"values": own.values, "t": own.t, "low": own.low, "high": own.high}
    return estimate


def _series(run: FitRun) -> list[dict[str, Any]]:
    problem, found = run.problem, []
    for each, part in zip(problem.measured, problem.parts, strict=True):
        own: dict[str, Any] = {
            "name": each.series.name,
            "file": each.series.file,
            "load_case": each.series.load_case,
            "response": words(each.series.response),
            "unit": unit_of(each.series.response),
            "deviation_estimated": each.deviation is None,
            "t": each.t,
            "measured": each.y,
        }
        if run.found is not None:
            misfit = run.found.misfit[part]
            own |= {
                "predicted": each.y + misfit,
                "deviation": run.found.deviation[part],
                "root_mean_square": float(np.sqrt(np.mean(misfit**2))),
                "chi_square": float(np.sum(run.found.residuals[part] ** 2)),
            }
        found.append(own)
    return found


def _deviations(problem: FitProblem, deviation: FloatArray) -> list[float | None]:
    """Of each series the deviation that was estimated, None where it is stated."""
    return [
        float(deviation[part.start]) if each.deviation is None else None
        for each, part in zip(problem.measured, problem.parts, strict=True)
    ]
