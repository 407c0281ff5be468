"""The comparisons: two bodies, a closed loop, a million members."""

import sys
from collections.abc import Iterator

from benchmarks.peers import scenes, settings
from benchmarks.peers.race import Field, race
from benchmarks.peers.tables import against_each, every_setting
from benchmarks.peers.translate import problem_of
from benchmarks.scenes import DESIGNS, design
from mdstopo.bench.reference import Reference, solution
from mdstopo.bench.tables import Table
from mdstopo.bench.work_precision import TIGHTEST, with_solver
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case

#: shares of the peers' times that are allowed
BAR, BAR_RING, BAR_FORWARD, BAR_MILLION = 0.2, 0.1, 0.02, 0.05


def tell(text: str) -> None:
    """What is being done goes where it does not mix with tables."""
    print(text, file=sys.stderr, flush=True)


def ring() -> Iterator[Table]:
    """A closed loop of ten bodies: with gradients beside CasADi and JAX, forward runs beside Exudyn and MuJoCo."""
    case = read_case(scenes.ring())
    course = field_of(case, "runge_kutta")
    whole = race(course, list(settings.ring()), tell)
    forward = race(course, list(settings.forward(hinges=True)), tell, seconds=0.02)
    for name, *both in zip(DESIGNS, whole, forward, strict=True):
        kinds = ("objective and gradient", BAR_RING), ("forward runs", BAR_FORWARD)
        for (what, bar), found in zip(kinds, both, strict=True):
            title = f"ring, {name} design, 1,000 members, {what}"
            yield every_setting(title, found)
            yield against_each(f"{title}: at equal error", found, bar)


def field_of(case: Case, integrator: str, tolerance: float = TIGHTEST, one_core: bool = True) -> Field:
    """What all run on, every design; the truth is our result by an integrator at its tightest tolerance."""
    tight = with_solver(case, integrator, tolerance)
    designs = [design(name, case.n_design) for name in DESIGNS]
    return Field(problem_of(case), designs, [Reference(*solution(tight, each)) for each in designs], one_core)
