"""Coefficients of ESDIRK4(3)6L[2]SA, in the form of `runge_kutta_tables` with a diagonal.

Kennedy and Carpenter, Additive Runge-Kutta schemes for convection-diffusion-reaction equations, Applied Numerical
Mathematics 44 (2003), the implicit part of ARK4(3)6L[2]SA: six stages, the first explicit, gamma = 1/4 on the diagonal
of the others, the last one the end of the step; of order 4 and L-stable, with an embedded method of order 3. Positions
are those of the first-order system q' = v: AA = A A, bb = b A.
"""

from fractions import Fraction
from functools import cache

import numpy as np

from mdstopo.integrators.runge_kutta_tables import AA, BB, E_Q, E_V, VECTORS, A, B, C
from mdstopo.scene.springs_model import FloatArray

STAGES, ORDER = 6, 4
#: rows of A; the last one has the weights b of the end
ROWS = (
    "0 0 0 0 0 0",
    "1/4 1/4 0 0 0 0",
    "8611/62500 -1743/31250 1/4 0 0 0",
    "5012029/34652500 -654441/2922500 174375/388108 1/4 0 0",
    "15267082809/155376265600 -71443401/120774400 730878875/902184768 2285395/8070912 1/4 0",
    "82889/524892 0 15625/83664 69875/102672 -2260/8211 1/4",
)
EMBEDDED = "4586570599/29645900160 0 178811875/945068544 814220225/1159782912 -3700637/11593932 61727/225920"


def _numbers(words: str) -> list[float]:
    return [float(Fraction(word)) for word in words.split()]


@cache
def esdirk_tables() -> FloatArray:
    """The method, twice, (2, 3, 17, 17), padded with zeros; not to be written to (see `gauss_tables` on the flag)."""
    a = np.array([_numbers(row) for row in ROWS])
    b = a[-1]
    error = b - np.array(_numbers(EMBEDDED))
    tables = np.zeros((2, 3, 17, 17))
    own = slice(STAGES)
    for table in tables:
        table[A, own, own], table[AA, own, own] = a, a @ a
        for row, values in ((C, a.sum(axis=1)), (B, b), (BB, b @ a), (E_V, error), (E_Q, error @ a)):
            table[VECTORS, row, own] = values
    return tables
