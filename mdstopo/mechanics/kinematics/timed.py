"""Quantities that are formulas of time: loads and driven coordinates. What they do to bodies is each dimension's.

A formula may give a driven coordinate, its rate or its acceleration. Of the latter two the coordinate is an integral
from the start of the segment, by Gauss' quadrature; segments are so short that it is right to rounding
(`general.scene.driven_integrals`).
"""

import numpy as np

from mdstopo.case.keys.time_formula import MOST_PARAMETERS
from mdstopo.compiler.formulas import call_formula
from mdstopo.compiler.jit import part
from mdstopo.formula.time_formulas import VALUE

#: columns of `GeneralModel.timed_par` and `driven_par`: parameters first, then where the formula is (0: there is none),
#: what it is multiplied by, what is added, and of driven coordinates which derivative of it the formula gives
ADDRESS, SCALE, OFFSET, DERIVED, WIDTH = range(MOST_PARAMETERS, MOST_PARAMETERS + 5)
#: the values of DERIVED
COORDINATE, RATE, ACCELERATION = range(3)
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(16)
#: points and weights of a quadrature over (0, 1)
NODES, WEIGHTS = tuple((0.5 + 0.5 * _POINTS).tolist()), tuple((0.5 * _WEIGHTS).tolist())
#: columns of `GeneralModel.timed_load`: the body, what acts on it, and as `load_follows`
BODY, KIND, TURNS = range(3)
#: what acts: a force at a point, a moment
PUSH, MOMENT = range(2)
#: columns of `GeneralModel.timed_arm`: the direction, and the point of attack
DIRECTION, ARM = 0, 3


@part
def timed_numbers(p, mode, t):
    """Value and rate of a formula of time, from its row of parameters.

    p (WIDTH,): its row. mode: bits of its switches. t: time (s).
    """
    x, v, a, _, _ = call_formula(p[ADDRESS], p, 0.0, 0.0, t, 0.0, mode, VALUE)
    return p[SCALE] * x + p[OFFSET], p[SCALE] * v, p[SCALE] * a


@part
def timed_load_size(model, segment, k, t):
    """Load k of those that are formulas, at a time of a segment (N, N m, rad/s^2)."""
    size, _, _ = timed_numbers(model.timed_par[k], model.timed_mode[segment, k], t)
    return size


@part
def driven_coordinate(model, segment, t, i):
    """Driven coordinate i at a time of a segment, its rate and its acceleration."""
    if model.driven_par[i, ADDRESS] != 0.0:
        if model.driven_par[i, DERIVED] != COORDINATE:
            return _integrated(model, segment, t, i)
        return timed_numbers(model.driven_par[i], model.driven_mode[segment, i], t)
    c = model.drive[segment, i]
    tau = t - model.times[segment]
    return (
        c[0] + tau * (c[1] + tau * (c[2] + tau * c[3])),
        c[1] + tau * (2.0 * c[2] + 3.0 * tau * c[3]),
        2.0 * c[2] + 6.0 * tau * c[3],
    )


@part
def _integrated(model, segment, t, i):
    """`driven_coordinate` where the formula gives its rate or its acceleration."""
    p = model.driven_par[i]
    mode = model.driven_mode[segment, i]
    c = model.drive[segment, i]
    start = model.times[segment]
    tau = t - start
    once = 0.0
    twice = 0.0
    for k in range(len(NODES)):
        f, _, _ = timed_numbers(p, mode, start + NODES[k] * tau)
        once += WEIGHTS[k] * f
        twice += WEIGHTS[k] * (1.0 - NODES[k]) * f
    value, rate, _ = timed_numbers(p, mode, t)
    if p[DERIVED] == RATE:
        return c[0] + tau * once, value, rate
    return c[0] + tau * (c[1] + tau * twice), c[1] + tau * once, value


@part
def most_of_load(model, k):
    """The largest size of load k of those that are formulas, at the ends and the middles of segments."""
    most = 0.0
    for segment in range(model.times.shape[0] - 1):
        start = model.times[segment]
        length = model.times[segment + 1] - start
        for half in range(3):
            most = max(most, abs(timed_load_size(model, segment, k, start + 0.5 * half * length)))
    return most
