"""Where steps are to end for the sake of an integral over time of the stored energy.

The integral is that of one more coordinate, by the weights of the stages, but no error control measures it. Where the
motion feels the members, steps that are short enough for it are short enough for their energy. A body that is hardly
slowed down passes by weak springs in a step or two, and their energy is no polynomial in it. So the energies of the
stages, which are there, are written as a sum of Legendre polynomials: how fast its terms fall off tells what a rule of
a given order leaves. Steps that leave too much are halved, and the motion is computed once more. Where that shows that
nothing was wrong, it is not taken.
"""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from mdstopo.integrators.gauss_tables import LEGENDRE, LEVELS, gauss_tables
from mdstopo.integrators.runge_kutta_tables import GENERAL, NYSTROEM, ORDERS, VECTORS, B, C, runge_kutta_tables
from mdstopo.integrators.steps import ENERGY, FIRST, carve
from mdstopo.scene.springs_model import FloatArray, IndexArray

if TYPE_CHECKING:
    from mdstopo.integrators.driver import Driver

#: how often a motion is computed anew: each time steps are halved
MOST_HALVINGS = 8
#: from this round on steps are halved no more where that leaves more than so much of what it was: the rest is rounding
PATIENCE, VAIN = 2, 0.7
#: what a step may leave by its terms, relative to the tolerance and the whole integral. In truth it leaves some hundred
#: times less: of 60 random scenes one or two have such a step, in vain. So what changes the integral by less than the
#: tolerance is not taken
LEFT_BY_STEP = 10.0


def quadrature_breakpoints(driver: "Driver", count: int) -> tuple[list[float], float, float]:
    """Middles of those of the last run's `count` steps whose energy their rule does not integrate; its integral, and
    what all steps leave of it by their terms."""
    n, n_pair, damped, turning = driver.shape
    t, _, index, scalar, *_ = carve.py_func(  # type: ignore[attr-defined]
        driver.room, driver.room_ints, n, n_pair, int(driver.limits[1]), int(driver.limits[2]), damped, turning
    )
    energy, first = scalar[:, ENERGY], index[: count + 1, FIRST]
    width = np.diff(t[: count + 1])
    left = np.zeros(count)
    whole = 0.0
    for w in range(count):
        rule, used, order = _rule(driver.method.collocates, damped, int(first[w + 1] - first[w]))
        terms = rule @ energy[first[w] + used]
        whole += width[w] * terms[0]
        sizes = np.abs(terms)
        largest, last = float(sizes.max()), float(sizes[-2:].max())
        if largest > 0.0:
            left[w] = width[w] * largest * (last / largest) ** (order / (len(sizes) - 1))
    bad = left > LEFT_BY_STEP * float(driver.settings[0]) * abs(whole)
    return (t[:count] + 0.5 * width)[bad].tolist(), float(whole), float(left.sum())


@cache
def _rule(collocates: bool, damped: bool, stages: int) -> tuple[FloatArray, IndexArray, int]:
    """What turns values at some stages into Legendre coefficients over the step, which stages, the rule's order."""
    if collocates:
        return gauss_tables()[LEVELS.index(stages), LEGENDRE, :stages, :stages], np.arange(stages), 2 * stages
    which = GENERAL if damped else NYSTROEM
    vectors = runge_kutta_tables()[which, VECTORS, :, :stages]
    used = np.flatnonzero(vectors[B] != 0.0)
    nodes, first = np.unique(vectors[C, used], return_index=True)  # two stages may stand at one time
    used = used[first]
    values = np.polynomial.legendre.legvander(2.0 * nodes - 1.0, len(nodes) - 1)
    inverse = np.asarray(np.linalg.inv(values), dtype=np.float64)
    return inverse, used.astype(np.int64), ORDERS[which]
