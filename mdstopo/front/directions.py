"""The points that a front is to have: weights, or evenly spaced anchors, as rows (W, m) that sum to 1."""

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: points of one front at most
MOST_POINTS = 100_000


def parse_range(text: str) -> list[float]:
    """The numbers of `a:b:step` (inclusive, evenly spaced) or of `x,y,z`. Raises ValueError with a sentence."""
    words = text.split(":")
    try:
        if len(words) == 1:
            values = [float(word) for word in text.split(",")]
        elif len(words) == 3:
            values = _spaced(*(float(word) for word in words))
        else:
            raise ValueError
    except ValueError as error:
        sentence = str(error) if "step" in str(error) else "allowed is a:b:step or a list a,b,c of numbers"
        raise ValueError(f"found {text!r}; {sentence}") from None
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"found {text!r}; every number must be finite")
    return values


def _spaced(first: float, last: float, step: float) -> list[float]:
    """Both ends and evenly spaced numbers between them: linspace, with the count that the step comes nearest to."""
    if first == last:
        return [first]
    if not (step != 0.0 and (last - first) / step > 0.0):
        raise ValueError("the step must be positive and lead from the first number to the last")
    count = (last - first) / step
    if count > MOST_POINTS:
        raise ValueError(f"a step of {step:g} makes more than {MOST_POINTS} points")
    if abs(count - round(count)) > 1e-6:
        raise ValueError(f"the step {step:g} does not divide the range {first:g} to {last:g}")
    return [float(x) for x in np.linspace(first, last, round(count) + 1)]


def weights_of_first(values: list[float]) -> Floats:
    """(W, 2) weights of two objectives from those of the first. Raises ValueError for one outside 0..1."""
    for value in values:
        if not 0.0 <= value <= 1.0:
            raise ValueError(f"the weight {value:g} is not between 0 and 1")
    if len(set(values)) < len(values):
        raise ValueError("a weight is given twice")
    first = np.array(values)
    return np.stack([first, 1.0 - first], axis=1)


def lattice(objectives: int, points: int) -> Floats:
    """(W, m) the simplex lattice (Das and Dennis 1998) with at least so many points; W itself for two objectives."""
    if objectives < 2:
        raise ValueError("a front needs at least two objectives")
    if points < objectives:
        raise ValueError(f"a front of {objectives} objectives needs at least {objectives} points")
    parts = 1
    while math.comb(parts + objectives - 1, objectives - 1) < points:
        parts += 1
    rows = []
    for bars in combinations(range(parts + objectives - 1), objectives - 1):
        edges = [-1, *bars, parts + objectives - 1]
        rows.append([edges[k + 1] - edges[k] - 1 for k in range(objectives)])
    return np.array(rows, dtype=np.float64) / parts
