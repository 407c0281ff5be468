"""The other end of `crew`: `python -m mdstopo.robust.worker`, spoken to over its standard streams."""

import os
import pickle
from typing import Any

from mdstopo.engine import Evaluator
from mdstopo.robust.ensemble import Ensemble
from mdstopo.robust.points import evaluator_at, nominal_case
from mdstopo.robust.sample import design_sample
from mdstopo.robust.trial import tried
from mdstopo.session.combining import even, problem_of
from mdstopo.session.crew import streams
from mdstopo.session.ready import get_ready


def main() -> None:
    """Read the case and the share, then one request after another, until the input is closed."""
    source, output = streams()
    case, share = pickle.load(source)
    nominal = nominal_case(case)
    engine = Evaluator(nominal)
    # the kernels in the one order in which every process loads them
    get_ready(nominal, engine, problem_of(engine, even(nominal)), None)
    sample = design_sample(case.uncertainty)
    ensemble = Ensemble(case, False, {i: evaluator_at(case, sample, i) for i in share})
    while True:
        try:
            kind, *request = pickle.load(source)
        except (EOFError, OSError, pickle.UnpicklingError):
            return  # the parent wants no more, or is gone, in the middle of a message perhaps
        if kind == "parts":
            names, design, gradient, sensitivity, wanted = request
            chosen = ensemble.looking_at(names)
            own = [i for i in wanted if i in chosen.points]
            answer: dict[int, Any] = {i: chosen.part(i, design, gradient, sensitivity) for i in own}
        else:
            other, design, places = request
            answer = {i: tried(case, other, i, design) for i in places}
        pickle.dump(answer, output)
        output.flush()


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        os._exit(1)
