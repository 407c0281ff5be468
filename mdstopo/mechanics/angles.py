"""Cosine and sine of an angle together, without a call: bodies are turned at every balance.

The angle less n quarter turns, |r| <= pi/4, is found with a quarter turn in three parts, of which two have so few
digits that their products with n are exact (W. J. Cody, W. Waite, Software Manual for the Elementary Functions, 1980);
of r the series are taken as far as a double sees them. Errors are below three units in the last place.
"""

import math

from mdstopo.compiler.jit import inline, part

#: a quarter turn, rad: 33 digits of it, the next 33, and the rest
QUARTER = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
#: quarter turns to a radian; added to a number of them and taken away again, ROUND leaves the nearest whole number
INVERSE, ROUND = 2.0 / math.pi, 1.5 * 2.0**52
#: the largest angle, rad, of which products with a quarter turn's parts are exact; what is beyond is left to `math`
FAR = 1e5
#: coefficients of the series, of r^3, r^5, ... and r^4, r^6, ..., the last ones below rounding
SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9))
COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(2, 9))


@inline
def _series(z):
    """(sin r - r)/r^3 and (cos r - 1 + r^2/2)/r^4 from z = r^2."""
    s = SINE[7]
    for k in range(6, -1, -1):
        s = s * z + SINE[k]
    c = COSINE[6]
    for k in range(5, -1, -1):
        c = c * z + COSINE[k]
    return s, c


@part
def small_turn(angle):
    """cos - 1 and sin of an angle, rad, both without cancellation where it is small."""
    if abs(angle) <= 0.7:
        z = angle * angle
        s, c = _series(z)
        return z * z * c - 0.5 * z, angle + angle * z * s
    c, s = cos_sin(angle)
    return c - 1.0, s


@part
def cos_sin(angle):
    """cos and sin of an angle, rad."""
    if not abs(angle) <= FAR:
        return math.cos(angle), math.sin(angle)
    turns = (angle * INVERSE + ROUND) - ROUND
    r = ((angle - turns * QUARTER[0]) - turns * QUARTER[1]) - turns * QUARTER[2]
    z = r * r
    s, c = _series(z)
    s = r + r * z * s
    half = 0.5 * z
    whole = 1.0 - half
    c = whole + (((1.0 - whole) - half) + z * z * c)
    n = int(turns)
    if n & 1 != 0:
        c, s = -s, c
    if n & 2 != 0:
        c, s = -c, -s
    return c, s
