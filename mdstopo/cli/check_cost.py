"""What one evaluation of a case will cost on this machine, as `check` tells it."""

import time
from typing import TYPE_CHECKING, Any

from mdstopo.cli.output import duration
from mdstopo.shown import counted

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.engine import Evaluator

#: an evaluation that took longer than this (s) is not made once more, to leave out what is only done the first time
ONCE = 2.0
#: what is said where kernels would have to be compiled
NOT_COMPILED = "kernels that it needs have not been compiled here yet; the first `gradient` or `run` compiles them"
UNKNOWN = f"not known: {NOT_COMPILED}"


def cost(case: "Case", engine: "Evaluator") -> dict[str, Any] | None:
    """Steps, force sums and milliseconds of one evaluation with gradients at the start, and the points of its sample.

    With a message alone where it fails; None where there are no responses, or kernels would have to be compiled first.
    """
    from mdstopo.compiler.entry import NotCompiledError, without_compiling

    if not case.objectives:
        return None
    points = 1
    if case.uncertainty is not None:
        from mdstopo.robust.ensemble import NOMINAL, Ensemble

        assert isinstance(engine, Ensemble)
        points, engine = len(engine.sample), engine.points[NOMINAL]
    try:
        with without_compiling():
            for _ in range(2):
                began = time.perf_counter()
                found = engine.evaluate(case.start)
                seconds = time.perf_counter() - began
                if seconds > ONCE or not found.status.usable:
                    break
    except NotCompiledError:
        return None
    if not found.status.usable:
        return {"message": f"{found.status.value} {found.message}".rstrip()}
    work = found.work
    return {
        "steps": work["steps"],
        "force_sums": work["force_sums"],
        "milliseconds": 1e3 * seconds * points,
        "points": points,
    }


def in_words(found: dict[str, Any] | None) -> str:
    """The result of `cost` as a sentence."""
    if found is None:
        return UNKNOWN
    if "message" in found:
        return f"fails with the initial design: {found['message']}"
    each = f"{counted(found['steps'], 'step')}, {counted(found['force_sums'], 'force sum')}"
    if found["points"] > 1:
        each = f"{found['points']} points of {each} or so"
    return f"{each}, {duration(1e-3 * found['milliseconds'])} here"
