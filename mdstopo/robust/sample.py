"""The points at which a case is evaluated: a quasi-random sample to design with, a random one to check with.

The design's sample is a rank-1 lattice, x_k = frac(k z / n + shift), whose generating vector z is built component by
component for the points and numbers at hand (Sloan and Reztsov 2002: each component minimises the worst-case error of a
weighted Korobov space, given those before), shifted at random by the seed, and folded by the baker's transformation
x -> 1 - |2 x - 1|, which makes means of smooth functions converge with n^-2 (Hickernell 2002). Scenarios are not
sampled: each meets every point, with its own probability. The check's sample is plain random, scenarios included, so
that textbook intervals hold.
"""

from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.objects.uncertain import Uncertainty

Floats = NDArray[np.float64]

#: components of a generating vector that are tried, at most
CANDIDATES = 256
#: what keeps the streams of both samples apart
_DESIGN, _CHECK = 1, 2


@dataclass(frozen=True)
class Sample:
    """S points. values (S, d): of the numbers that vary; probability (S,), of sum 1; scenario (S,): its place or -1."""

    values: Floats
    probability: Floats
    scenario: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.probability)


def design_sample(uncertainty: Uncertainty) -> Sample:
    """The fixed sample that objectives are measured on; the scenarios alone where no number has a distribution."""
    n = uncertainty.sample if uncertainty.numbers else 1
    values = _values(uncertainty, lattice(n, len(uncertainty.numbers), uncertainty.seed))
    if not uncertainty.scenarios:
        return Sample(values, np.full(n, 1.0 / n), np.full(n, -1))
    count = len(uncertainty.scenarios)
    shares = np.array([each.probability for each in uncertainty.scenarios])
    return Sample(np.tile(values, (count, 1)), np.repeat(shares / n, n), np.repeat(np.arange(count), n))


def check_sample(uncertainty: Uncertainty) -> Sample | None:
    """The fresh sample for the end; None where the case has none, or no number varies."""
    n = uncertainty.validation
    if not n or not uncertainty.numbers:
        return None
    rng = np.random.default_rng([uncertainty.seed, 0, _CHECK])
    values = _values(uncertainty, rng.random((n, len(uncertainty.numbers))))
    scenario = np.full(n, -1)
    if uncertainty.scenarios:
        below = np.cumsum([each.probability for each in uncertainty.scenarios])
        scenario = np.minimum(np.searchsorted(below, rng.random(n), side="right"), len(below) - 1)
    return Sample(values, np.full(n, 1.0 / n), scenario.astype(np.int64))


def lattice(n: int, d: int, seed: int) -> Floats:
    """n points (n, d) in the open unit cube: the shifted, folded lattice."""
    if not d:
        return np.zeros((n, 0))
    shift = np.random.default_rng([seed, 0, _DESIGN]).random(d)
    x = (np.outer(np.arange(n), generators(n, d)) % n) / n + shift
    folded = 1.0 - np.abs(2.0 * (x - np.floor(x)) - 1.0)
    return np.clip(folded, 2.0**-53, 1.0 - 2.0**-53)


def generators(n: int, d: int) -> NDArray[np.int64]:
    """The generating vector (d,) of a lattice of n points, chosen component by component; later components weigh
    less."""
    every = [z for z in range(1, max(n // 2, 1) + 1) if gcd(z, n) == 1]
    candidates = every[:: -(-len(every) // CANDIDATES)]
    places = np.arange(n)
    product = np.ones(n)
    chosen: list[int] = []
    for j in range(d):
        errors = [float((product * _kernel(places * z % n / n, j)).sum()) for z in candidates]
        # errors that differ by rounding alone are equal, so that every machine chooses the same
        best = min(range(len(candidates)), key=lambda i: (float(f"{errors[i]:.9e}"), candidates[i]))
        chosen.append(candidates[best])
        product = product * _kernel(places * candidates[best] % n / n, j)
    return np.array(chosen, dtype=np.int64)


def _kernel(x: Floats, j: int) -> Floats:
    """1 + gamma_j 2 pi^2 B_2(x), with gamma_j = 1/(j + 1)."""
    return 1.0 + 2.0 * np.pi**2 / (j + 1) * (x * x - x + 1.0 / 6.0)


def _values(uncertainty: Uncertainty, points: Floats) -> Floats:
    """The numbers at points of the unit cube."""
    values = np.empty_like(points)
    for j, number in enumerate(uncertainty.numbers):
        values[:, j] = [number.distribution.quantile(u) for u in points[:, j].tolist()]
    return values
