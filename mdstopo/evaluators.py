"""Which evaluator a case needs. It is imported with the first one: it brings the compiler with it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mdstopo.case.model import Case
from mdstopo.starts.evaluator_interface import Engine

if TYPE_CHECKING:
    from mdstopo.engine import Evaluator


def evaluator_of(case: Case, beside: bool = True, share: Sequence[str] = ()) -> "Evaluator":
    """The case compiled, with its whole sample where something in it is uncertain.

    beside, share: as of `Evaluator`. Raises CaseError where the case asks for what the engine cannot do, or is none at
    a point of its sample.
    """
    if case.uncertainty is None:
        from mdstopo.engine import Evaluator

        return Evaluator(case, beside, share)
    from mdstopo.robust.ensemble import Ensemble

    return Ensemble(case, beside, share=share)


def make_engine(case: Case) -> Engine:
    """As `evaluator_of`, as what a run takes: what makes its engines."""
    return evaluator_of(case)
