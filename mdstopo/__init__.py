"""mdstopo: topology optimisation of the members that tie multibody systems together.

Four calls run the same engine as the command line: `load_case`, `simulate`, `evaluate`, `optimize`.
Names are resolved on first use, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING

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


#: names that need no engine, with their modules; the others are those of `api`
_WITHOUT_ENGINE = {
    "Case": "mdstopo.case.model",
    "CaseError": "mdstopo.case.text.errors",
    "load_case": "mdstopo.case.reader",
}

if not TYPE_CHECKING:  # for type checkers, names that are not there are mistakes

    def __getattr__(name):
        if name in __all__:
            value = getattr(import_module(_WITHOUT_ENGINE.get(name, "mdstopo.api")), name)
            globals()[name] = value
            return value
        raise AttributeError(f"module 'mdstopo' has no attribute {name!r}")


def __dir__() -> list[str]:
    """What there is to use, whether it has been resolved or not."""
    return sorted([*__all__, "__doc__", "__file__", "__name__", "__path__"])
