"""A run with the fake engine as a process to be killed: fake_run.py FILE ITERATIONS DELAY [resume]."""

import sys
from pathlib import Path

from mdstopo.cli.interrupt import Interrupts
from mdstopo.session.run_session import run_session
from tests.fakes import FakeEngineWithEvaluations, hand_made_case, limited

path, iterations, delay = Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
case = limited(hand_made_case(), iterations)
outcome = run_session(
    case,
    path=path,
    resume="resume" in sys.argv,
    stop_requested=Interrupts().stop_requested,
    on_iteration=lambda progress: print(progress.iteration, flush=True),
    engine=lambda case: FakeEngineWithEvaluations(case, delay),
)
print(outcome.status)
