"""What is kept of a fit: datasets of a result file, and the same as plain values to be told, drawn and gone on with."""

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.methods.losses import DEFAULT_LOSS
from mdstopo.case.model import Case
from mdstopo.case.responses.response_units import unit_of, words
from mdstopo.engine import Evaluator
from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.prepared import case_at
from mdstopo.fit.run_fit import FitRun
from mdstopo.store.contents import Contents, Datasets, case_part, design_part, trajectory_part
from mdstopo.store.image import Attribute
from mdstopo.store.json_values import json_value
from mdstopo.store.result_reader import ResultView
from mdstopo.store.same_case import describe
from mdstopo.store.store_errors import StoreError
from mdstopo.store.writing import write_result

#: the kind of result files of fits
KIND = "fit"
#: names of bounds that hold an estimate, as files have them
_BOUNDS = {-1: "lower", 1: "upper"}


class FitFile:
    """The result file of a fit, which is replaced as a whole whenever there is more to keep.

    path: a place that this process may write. command: the command line, for the record. fitted_before: the text of the
    fitted case that is there until this fit writes its own; None where there is none.
    """

    def __init__(self, path: Path, problem: FitProblem, command: str = "", fitted_before: str | None = None) -> None:
        self.path = path
        case, fit = problem.case, problem.case.fit
        assert fit is not None
        fixed = case_part(case) | design_part(case, case.start) | _digests(problem)
        settings: dict[str, Attribute] = {
            "loss": fit.loss, "confidence": fit.confidence, "starts": fit.starts, "seed": fit.seed,
        }  # fmt: skip
        self._contents = Contents.begun(case, KIND, command, fixed, settings)
        # a fit that is killed has to know the fitted case as one of its own when it goes on
        self._fitted_before: Datasets = {} if fitted_before is None else {"fit/fitted_case": fitted_before}

    def checkpoint(self, run: FitRun) -> None:
        """Save in the middle. Raises StoreError."""
        write_result(self.path, self._contents.now("running", "running", datasets(run) | self._fitted_before))

    def conclude(self, run: FitRun, fitted_case: str | None, warnings: tuple[str, ...]) -> None:
        """Save what has come to its end, with the fitted motion. Raises StoreError.

        fitted_case: the text of the case with the fitted numbers. warnings: sentences.
        """
        part = datasets(run) | trajectory_part(_motions(run)) | self._fitted_before
        if fitted_case is not None:
            part["fit/fitted_case"] = fitted_case
        write_result(self.path, self._contents.now(run.status, run.reason, part, warnings))


def _digests(problem: FitProblem) -> Datasets:
    """SHA-256 of the measured files that are there."""
    folder = Path() if problem.case.path is None else problem.case.path.parent
    files = {each.file: folder / each.file for each in problem.fit.series}
    return {
        f"files/{name}": hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items() if path.is_file()
    }


def _motions(run: FitRun) -> dict[str, Any]:
    """The fitted motion in each load case with measurements."""
    if run.minimum is None:
        return {}
    numbers = run.problem.numbers
    evaluator = Evaluator(numbers.case_at(run.minimum.x[: len(numbers.keys)]), in_background=False)
    names = dict.fromkeys(each.load_case for each in run.problem.fit.series)
    return {name: evaluator.trajectory(evaluator.case.start, name) for name in names}


def datasets(run: FitRun) -> Datasets:
    """All of a run, by the path in its file."""
    problem = run.problem
    part: Datasets = {
        "asked": asked(problem),
        "simulations": np.array(run.simulations),
        "estimates": list(problem.names),
        "derivative": list(problem.derivatives),
        "lower": problem.lower,
        "upper": problem.upper,
        "initial": problem.initial,
    }
    if run.shown is not None:
        part["value"] = run.shown.x
    told = run.statistics
    if told is not None:
        part |= {
            "deviation": told.deviation, "low": told.low, "high": told.high,
            "at_bound": told.at_bound.astype(np.int64), "correlation": told.correlation,
            "freedom": np.array(told.freedom), "chi_square": np.array(told.chi_square),
            "directions/change": np.array([each.change for each in told.directions]),
            "directions/unknown": np.array([each.is_unknown for each in told.directions], dtype=np.bool_),
            "directions/shares": np.array(
                [[each.shares.get(name, 0.0) for name in problem.names] for each in told.directions]
            ).reshape(len(told.directions), len(problem.names)),
        }  # fmt: skip
    for name, own in run.profiles.items():
        part |= {f"profiles/{name}/values": own.values, f"profiles/{name}/t": own.t}
        part[f"profiles/{name}/ends"] = np.array([own.low, own.high])
    part |= _series(run) | _starts(run) | _evaluations(run)
    return {f"{KIND}/{name}": value for name, value in part.items()}


def _series(run: FitRun) -> Datasets:
    """What was measured, what is predicted there, and what is left."""
    problem, shown = run.problem, run.shown
    series = [each.series for each in problem.measured]
    part: Datasets = {
        "series/name": [each.name for each in series],
        "series/file": [each.file for each in series],
        "series/load_case": [each.load_case for each in series],
        "series/response": [words(each.response) for each in series],
        "series/unit": [unit_of(each.response) for each in series],
        "series/deviation_estimated": np.array([each.deviation is None for each in problem.measured], dtype=np.bool_),
    }
    if shown is not None:
        for key, places in (("offset", problem.offsets), ("delay", problem.delays)):
            part[f"series/{key}"] = np.array(
                [shown.x[p] if p >= 0 else getattr(each, key).initial for each, p in zip(series, places, strict=True)]
            )
        residuals = shown.misfit / shown.deviation
        part["series/root_mean_square"] = problem.root_mean_squares(shown.misfit)
        part["series/chi_square"] = np.array([float(np.sum(residuals[own] ** 2)) for own in problem.parts])
    for each, own in zip(problem.measured, problem.parts, strict=True):
        group = f"measured/{each.series.name}"
        part |= {f"{group}/t": each.t, f"{group}/value": each.y}
        if shown is not None:
            part |= {f"{group}/predicted": each.y + shown.misfit[own], f"{group}/deviation": shown.deviation[own]}
    return part


def _starts(run: FitRun) -> Datasets:
    """The starts that are done, and which of them is the best."""
    p, s, done = len(run.problem.names), len(run.problem.measured), run.starts
    part: Datasets = {
        "starts/begin": np.array([each.begin for each in done]).reshape(len(done), p),
        "starts/x": np.array([each.x for each in done]).reshape(len(done), p),
        "starts/deviation": np.array([_deviations(run.problem, each.deviation) for each in done]).reshape(len(done), s),
        "starts/level": np.array([each.level for each in done]),
        "starts/status": [each.status for each in done],
        "starts/reason": [each.reason for each in done],
        "starts/evaluations": np.array([each.evaluations for each in done], dtype=np.int64),
    }
    if done:
        part |= {"best": np.array(run.best), "agreeing": np.array(run.agreeing)}
    return part


def _evaluations(run: FitRun) -> Datasets:
    """How the fit came where it is: every motion that the starts have tried."""
    p, s, trace = len(run.problem.names), len(run.problem.measured), run.trace
    return {
        "evaluations/start": np.array([each.start for each in trace], dtype=np.int64),
        "evaluations/x": np.array([each.x for each in trace]).reshape(len(trace), p),
        "evaluations/root_mean_square": np.array([each.root_mean_squares for each in trace]).reshape(len(trace), s),
    }


def _deviations(problem: FitProblem, deviation: FloatArray) -> list[float]:
    """Of each series the deviation that was estimated, NaN where it is stated."""
    return [
        float(deviation[part.start]) if each.deviation is None else math.nan
        for each, part in zip(problem.measured, problem.parts, strict=True)
    ]


def asked(problem: FitProblem) -> str:
    """A digest of the question and the measurements: a fit goes on only where it is the same."""
    digest = hashlib.sha256(describe(problem.case).encode())
    digest.update(repr(problem.fit).encode())
    for each in problem.measured:
        for array in (each.t, each.y, each.deviation):
            digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


# -- read back


def fitted_case(view: ResultView, case: Case) -> Case:
    """The case that pictures are of: with the fitted numbers, and the measured series as its objectives.

    case: that of the file, with the numbers as they were stated.
    """
    assert case.fit is not None
    keys = [each.key for each in case.fit.numbers]
    values = view.arrays.get(f"{KIND}/value")
    x = np.array([each.range.initial for each in case.fit.numbers]) if values is None else values[: len(keys)]
    return case_at(case, keys, np.asarray(x, dtype=np.float64))


def content(view: ResultView) -> dict[str, Any]:
    """A fit as plain values, as JSON has them; null for what is not known. Raises StoreError where it is no fit."""
    if view.kind != KIND:
        raise StoreError(f"{view.path} holds a result of `{view.kind}`, not of `fit`")
    arrays = view.under(KIND)
    whole: dict[str, Any] = json_value(
        {
            "case": view.name,
            "title": view.title,
            "status": view.status,
            "reason": view.reason,
            "loss": view.settings.get("loss", DEFAULT_LOSS),
            "confidence": view.settings.get("confidence", 0.95),
            **{
                key: arrays.get(key)
                for key in ("simulations", "correlation", "freedom", "chi_square", "best", "agreeing")
            },
            "estimates": _read_estimates(view),
            "directions": _read_directions(view),
            "series": _read_series(view),
            "starts": _rows(view, "starts", texts=("status", "reason")),
            "evaluations": _rows(view, "evaluations"),
        }
    )
    return whole


def _rows(view: ResultView, group: str, texts: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """The columns of a group as one mapping for each row."""
    columns: dict[str, Any] = dict(view.under(f"{KIND}/{group}"))
    columns |= {name: view.lines(f"{KIND}/{group}/{name}") for name in texts}
    count = min((len(column) for column in columns.values()), default=0)
    return [{name: column[k] for name, column in columns.items()} for k in range(count)]


def _read_estimates(view: ResultView) -> list[dict[str, Any]]:
    arrays, found = view.under(KIND), []
    names = view.lines(f"{KIND}/estimates")
    for i, (name, how) in enumerate(zip(names, view.lines(f"{KIND}/derivative"), strict=True)):
        own: dict[str, Any] = {"name": name, "derivative": how}
        own |= {key: arrays[key][i] for key in ("lower", "upper", "initial")}
        own |= {key: arrays[key][i] for key in ("value", "deviation", "low", "high") if key in arrays}
        if "at_bound" in arrays:
            own["at_bound"] = _BOUNDS.get(int(arrays["at_bound"][i]))
        if f"profiles/{name}/t" in arrays:
            values, t, (low, high) = (arrays[f"profiles/{name}/{key}"] for key in ("values", "t", "ends"))
            own["profile"] = {"values": values, "t": t, "low": low, "high": high}
        found.append(own)
    return found


def _read_directions(view: ResultView) -> list[dict[str, Any]] | None:
    arrays, names = view.under(f"{KIND}/directions"), view.lines(f"{KIND}/estimates")
    if "change" not in arrays:
        return None
    return [
        {
            "shares": {name: share for name, share in zip(names, arrays["shares"][k], strict=True) if share != 0.0},
            "change": change,
            "unknown": arrays["unknown"][k],
        }
        for k, change in enumerate(arrays["change"])
    ]


def _read_series(view: ResultView) -> list[dict[str, Any]]:
    found = _rows(view, "series", texts=("name", "file", "load_case", "response", "unit"))
    for own in found:
        own |= {
            {"value": "measured"}.get(key, key): column
            for key, column in view.under(f"{KIND}/measured/{own['name']}").items()
        }
    return found
