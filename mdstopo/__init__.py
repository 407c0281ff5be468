"""mdstopo: topology optimisation of the members that tie multibody systems together.

Four calls run the same engine as the command line: `load_case`, `simulate`, `evaluate`, `optimize`.
Names are resolved on first use, so that importing the package costs nothing.
"""

from typing import TYPE_CHECKING, Any

from mdstopo._version import __version__

if TYPE_CHECKING:
    from mdstopo.api import (
        Case,
        CaseError,
        Evaluation,
        Result,
        Trajectory,
        evaluate,
        load_case,
        optimize,
        simulate,
    )

__all__ = [
    "Case",
    "CaseError",
    "Evaluation",
    "Result",
    "Trajectory",
    "__version__",
    "evaluate",
    "load_case",
    "optimize",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from mdstopo import api

        value = getattr(api, name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'mdstopo' has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names, those not resolved yet too, so that `dir` and completion show the calls."""
    return sorted({*globals(), *__all__})
