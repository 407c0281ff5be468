"""Which evaluator a case needs. It is imported with the first one: it brings the compiler with it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mdstopo.case.model import Case
from mdstopo.starts.evaluator_interface import Engine

if TYPE_CHECKING:
    from mdstopo.engine import Evaluator


def evaluator_of(case: Case, in_background: bool = True, share: Sequence[str] = ()) -> "Evaluator":
    """The case compiled, with its whole sample where something in it is uncertain.

    in_background, share: as of `Evaluator`. Raises CaseError where the case asks for what the engine cannot do, or is
    none at a point of its sample.
    """
    if case.uncertainty is None:
        from mdstopo.engine import Evaluator

        return Evaluator(case, in_background, share)
    from mdstopo.robust.ensemble import Ensemble

    return Ensemble(case, in_background, share=share)


def make_engine(case: Case) -> Engine:
    """As `evaluator_of`, in the form in which a run makes its evaluators."""
    return evaluator_of(case)
