"""Whether the members kept hold a machine that settles where the full design has it, or let it fall somewhere else.

The sizes are changed little by little from the full design to the final one, in which the others have none, and the
equilibrium is followed: each is sought from the last. Where it moves as little as the sizes do, the final design rests
at the same equilibrium, however far it sags. Where it does not, the machine has lost its hold on the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.model import Case
from mdstopo.case.text.words import number_text, shown
from mdstopo.engine import Evaluator
from mdstopo.general.at_rest.settle import settle
from mdstopo.general.driver.general_driver import GeneralDriver
from mdstopo.general.scene.extent import size_of
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics

#: the farthest that an equilibrium goes in one step of the sizes: in sizes of the scene, and in rad
LONGEST_MOVE, LONGEST_TURN = 0.01, 0.05
#: the first step of the sizes, and the shortest one: where even that is too far, there is a jump
FIRST_STEP, SHORTEST_STEP = 1.0 / 8.0, 1.0 / 4096.0
#: how far the place of rest may move from that of the full design without a word: in sizes of the scene, and in rad
MOVED_FAR, TURNED_FAR = 0.05, 0.1


@dataclass(frozen=True)
class Comparison:
    """How two equilibria differ. lost: why the final design does not rest at that of the full one; moved: how far it
    has moved.

    Both in words, and empty where there is nothing to tell.
    """

    lost: str = ""
    moved: str = ""


def compare_equilibria(case: Case, design: FloatArray, end: FloatArray, reduced: Case, now: FloatArray) -> Comparison:
    """Compare where a case settles with its design and where one with fewer members does, in every load case.

    design (N + P,), now (K + Q,): the designs of the case and of the reduced one; end (N + P,): the latter as one of
    the case, alpha of the members left out being 0. Nothing is told of cases that do not settle, nor where one of the
    designs has no equilibrium: that is told elsewhere.
    """
    if not case.solver.settle:
        return Comparison()
    moved = ""
    whole, few = Evaluator(case), Evaluator(reduced)
    for load_case in case.load_cases:
        begun, ended = whole.settled(design, load_case.name), few.settled(now, load_case.name)
        if begun is None or ended is None:
            continue
        where = f"in load case {load_case.name} " if len(case.load_cases) > 1 else ""
        driver = whole.driver(load_case.name)
        assert isinstance(driver, GeneralDriver)  # what settles is no scene of springs alone
        bodies = driver.scene.kinematics
        far = _Distance(case, bodies, begun.q, ended.q)
        words = f"{where}the final design rests {far} away from where the full one does"
        tracked = _followed(driver, case, design, end, begun.q)
        if tracked is None or _Distance(case, bodies, tracked, ended.q).is_beyond(LONGEST_MOVE, LONGEST_TURN):
            return Comparison(f"{words}, at another equilibrium: the members kept do not hold it")
        if far.is_beyond(MOVED_FAR, TURNED_FAR):
            moved = moved or words
    return Comparison(moved=moved)


class _Distance:
    """How far the bodies of a case are apart in two states (n_q,); bodies: how they move."""

    def __init__(self, case: Case, bodies: Kinematics, one: FloatArray, other: FloatArray) -> None:
        shift, turn = bodies.shifts_and_turns(bodies.difference(other, one))
        distance, angle = np.linalg.norm(shift, axis=1), np.linalg.norm(turn, axis=1)
        names = [body.name for body in case.bodies]
        self.size = size_of(case)
        self.distance, self.body = float(distance.max()), names[int(distance.argmax())]
        self.angle, self.turned = float(angle.max()), names[int(angle.argmax())]

    def is_beyond(self, sizes: float, angle: float) -> bool:
        """Whether a body is farther away than so many sizes of the scene, or turned by more than an angle, rad."""
        return self.distance > sizes * self.size or self.angle > angle

    def __str__(self) -> str:
        return (
            f"{number_text(float(f'{self.distance:.3g}'))} m (body {shown(self.body)}) and "
            f"{number_text(float(f'{self.angle:.3g}'))} rad (body {shown(self.turned)})"
        )


def _followed(
    driver: GeneralDriver, case: Case, begin: FloatArray, end: FloatArray, q: FloatArray
) -> FloatArray | None:
    """The equilibrium (n,) of the design `end`, followed from that of `begin`, q; None where it jumps or ends."""
    size, share, step = size_of(case), 0.0, FIRST_STEP
    while share < 1.0:
        step = min(step, 1.0 - share)
        driver.take(begin + (share + step) * (end - begin))
        driver.start_from(q)
        found = settle(driver, driver.alpha.copy(), q, size)
        if isinstance(found, str) or _Distance(case, driver.scene.kinematics, q, found.q).is_beyond(
            LONGEST_MOVE, LONGEST_TURN
        ):
            if step <= SHORTEST_STEP:
                return None
            step /= 4.0
            continue
        q, share, step = found.q, share + step, 2.0 * step
    return q
