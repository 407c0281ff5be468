"""Which evaluator a case needs."""

from collections.abc import Sequence

from mdstopo.case.model import Case
from mdstopo.engine import Evaluator


def evaluator_of(case: Case, beside: bool = True, share: Sequence[str] = ()) -> Evaluator:
    """The case compiled, with its whole sample where something in it is uncertain.

    beside, share: as of `Evaluator`. Raises CaseError where the case asks for what the engine cannot do, or is none at
    a point of its sample.
    """
    if case.uncertainty is None:
        return Evaluator(case, beside, share)
    from mdstopo.robust.ensemble import Ensemble

    return Ensemble(case, beside, share=share)
