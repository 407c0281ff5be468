"""The comparisons: two bodies, any case, a closed loop, a seated occupant, a million members."""

import sys
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from benchmarks.peers import ours_seat, scenes, settings
from benchmarks.peers.problem import Floats
from benchmarks.peers.race import Entry, Field, Measured, race
from benchmarks.peers.table import PEERS_IN_SPACE, PEERS_OF_SEAT
from benchmarks.peers.tables import LEVELS, against_each, every_setting, standings
from benchmarks.peers.translate import problem_of, spatial_problem_of
from benchmarks.peers.translate_seat import seat_problem_of
from benchmarks.scenes import DESIGNS, SCENES, design, scene
from mdstopo.bench.reference import Reference, solution
from mdstopo.bench.scenes import plate
from mdstopo.bench.tables import Table
from mdstopo.bench.work_precision import TIGHTEST, with_solver
from mdstopo.case.model import Case
from mdstopo.case.reader import load_case, read_case
from mdstopo.scene.bodies import is_spatial

#: shares of the peers' times that are allowed
BAR, BAR_LOOSE, BAR_LOOP, BAR_FORWARD, BAR_MILLION = 0.1, 0.15, 0.1, 0.02, 0.05
MILLION = 1_000_000

#: a named scene and design, with what was measured there
Group = tuple[str, Sequence[Measured]]
Tell = Callable[[str], None]


def _tell(text: str) -> None:
    """What is being done goes where it does not mix with tables."""
    print(text, file=sys.stderr, flush=True)


def peers() -> Iterator[Table]:
    """The paper's two bodies and their variants with an inner peak."""
    yield from compared(paper_groups(_tell))


def paper_groups(tell: Tell) -> Iterator[Group]:
    """Both scenes at both designs."""
    for name in SCENES:
        course = field_of(scene(name), "runge_kutta")
        tell(f"{name}:")
        found = race(course, list(settings.two_bodies(at_end=name == "fig6")), tell)
        yield from zip((f"{name}, {own}" for own in DESIGNS), found, strict=True)


def case_groups(case: Case, tell: Tell) -> Iterator[Group]:
    """Any case that the peers can compute, at its initial design. Raises NotForPeersError for others."""
    problem = problem_of(case)
    entries: list[Entry] = list(settings.any_case(hinges=bool(len(problem.hinges))))
    truth = Reference(*solution(with_solver(case, "runge_kutta", TIGHTEST), case.initial))
    (found,) = race(Field(problem, [np.array(case.initial)], [truth]), entries, tell)
    yield case.title or case.name, found


def compared(groups: Iterator[Group]) -> Iterator[Table]:
    """A table for each group, and one of the fastest."""
    known: list[Group] = []
    for name, found in groups:
        yield every_setting(f"Work and precision beside other programs: {name}", found)
        known.append((name, found))
    yield standings("Objective and exact gradient beside the fastest peer", known, LEVELS, BAR)


def ring() -> Iterator[Table]:
    """A closed loop of ten bodies: with gradients beside CasADi and JAX, forward runs beside Exudyn and MuJoCo."""
    course = field_of(read_case(scenes.ring()), "runge_kutta")
    title = "A ring of ten links, 1,000 members"
    found = race(course, list(settings.ring()), _tell)
    yield from _at_equal_error(f"{title}, objective and gradient", found, BAR_LOOP)
    found = race(course, list(settings.forward(hinges=True)), _tell, seconds=0.02)
    yield from _at_equal_error(f"{title}, forward runs", found, BAR_FORWARD)


def forward() -> Iterator[Table]:
    """Forward runs of the paper's two bodies beside Exudyn and MuJoCo."""
    course = field_of(scene("end"), "runge_kutta")
    found = race(course, list(settings.forward(hinges=False)), _tell, seconds=0.02)
    yield from _at_equal_error("Two bodies, 1020 members, forward runs", found, BAR_FORWARD)


def _at_equal_error(
    title: str, found: Sequence[Sequence[Measured]], bar: float, designs: Sequence[str] = DESIGNS
) -> Iterator[Table]:
    for name, own in zip(designs, found, strict=True):
        yield every_setting(f"{title}, {name} design", own)
        yield against_each(f"{title}, {name} design, at equal error", own, bar)


def seat() -> Iterator[Table]:
    """The seated occupant of cases/restraint.yaml, with contacts and slack, beside JAX."""
    case = load_case(scenes.SEAT, overrides=scenes.SEAT_CHANGES)
    problem = seat_problem_of(case)
    designs = {"initial": np.array(case.initial), "random": np.random.default_rng(7).uniform(0.02, 0.5, case.n_design)}
    tight = ours_seat.make(problem, tolerance=1e-11)
    truths = [Reference(*tight(alpha, True)) for alpha in designs.values()]
    course = Field(problem, list(designs.values()), truths)
    found = race(course, list(settings.seat()), _tell, peers=PEERS_OF_SEAT)
    yield from _at_equal_error("A seated occupant, objective and gradient", found, BAR, list(designs))


def million() -> Iterator[Table]:
    """A million members between the two bodies beside JAX, each on all processors."""
    case = read_case(plate(MILLION))
    course = field_of(case, "runge_kutta", designs=DESIGNS[:1], one_core=False)
    (found,) = race(course, list(settings.million()), _tell, rounds=5, seconds=0.3)
    title = f"Two bodies, {case.n_design:,} members"
    yield every_setting(title, found)
    yield standings(f"{title}, beside the fastest peer", [("plate, uniform", found)], LEVELS[:2], BAR_MILLION)


def peers_space() -> Iterator[Table]:
    """Two bodies in space with 1,020 springs, beside JAX and CasADi."""
    course = field_of(read_case(scenes.spatial_pair()), "runge_kutta")
    found = race(course, list(settings.two_bodies_in_space()), _tell, peers=PEERS_IN_SPACE)
    groups = [(f"space, {own}", each) for own, each in zip(DESIGNS, found, strict=True)]
    title = "Work and precision in space beside other programs: two bodies, 1,020 springs"
    for name, own in groups:
        yield every_setting(f"{title}, {name}", own)
    yield standings("Two bodies in space beside the fastest peer", groups, LEVELS[:1], BAR_LOOSE)
    yield standings("Two bodies in space beside the fastest peer", groups, LEVELS[1:], BAR)


def ring_space() -> Iterator[Table]:
    """A closed loop of ten bodies in space: with gradients beside CasADi and JAX, forward beside Exudyn and MuJoCo."""
    course = field_of(read_case(scenes.spatial_ring()), "runge_kutta")
    title = "A spatial ring of ten links, 1,000 members"
    found = race(course, list(settings.ring_in_space()), _tell, peers=PEERS_IN_SPACE)
    yield from _at_equal_error(f"{title}, objective and gradient", found, BAR_LOOP)
    found = race(course, list(settings.forward_in_space(joints=True)), _tell, seconds=0.02, peers=PEERS_IN_SPACE)
    yield from _at_equal_error(f"{title}, forward runs", found, BAR_FORWARD)


def forward_space() -> Iterator[Table]:
    """Forward runs of two bodies in space beside Exudyn and MuJoCo."""
    course = field_of(read_case(scenes.spatial_pair(over_time="final")), "runge_kutta")
    entries = list(settings.forward_in_space(joints=False))
    found = race(course, entries, _tell, seconds=0.02, peers=PEERS_IN_SPACE)
    yield from _at_equal_error("Two bodies in space, 1020 members, forward runs", found, BAR_FORWARD)


def field_of(case: Case, integrator: str, designs: Sequence[str] = DESIGNS, one_core: bool = True) -> Field:
    """What all run on; the truth is our result by an integrator at its tightest tolerance.

    For the paper's scenes that is what two independent ways gave (SciPy's sensitivities, JAX), to 4e-13.
    """
    tight = with_solver(case, integrator, TIGHTEST)
    alphas: list[Floats] = [design(name, case.n_design) for name in designs]
    problem = spatial_problem_of(case) if is_spatial(case) else problem_of(case)
    return Field(problem, alphas, [Reference(*solution(tight, each)) for each in alphas], one_core)
