"""Powers of many numbers at once, several times faster than one after another, and the largest of many.

A loop that is to be vectorised writes one array: for more the compiler would have to prove more of them apart than it
tries to. A maximum is taken over the numbers' bits, because that of floats is not vectorised while NaN counts.
"""

import numpy as np

from mdstopo.compiler.jit import member_kernel
from mdstopo.optimizer.problem import Floats, Ints

#: terms that the series of `primitives` may have, a multiple of four, and what the next one may be of the first
MOST_TERMS, NEGLIGIBLE = 48, 1e-17
#: numbers from which on it would not do
FARTHEST = 0.6
#: all bits of a float but its sign
SIZE = 0x7FFF_FFFF_FFFF_FFFF
LN2 = 0.6931471805599453
#: ln 2 in two parts, the first with enough trailing zeros that its product with an exponent is exact
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10


@member_kernel
def powers(t: Floats, exponent: float, out: Floats, room: Ints) -> None:
    """out = t^exponent for normal t > 0, to a few units in the last place. room: (3, n).

    Every loop reads and writes different memory, which is what lets the compiler vectorise it.
    """
    bits = t.view(np.int64)
    near, whole, scale = room[0], room[1], room[2]
    z, twos = near.view(np.float64), scale.view(np.float64)
    n = len(t)
    for i in range(n):
        # t = 2^k z, with z between the roots of 1/2 and 2
        k = (bits[i] - 0x3FE6A09E00000000) >> 52
        near[i] = bits[i] - (k << 52)
        whole[i] = k
    for i in range(n):
        # log z by the series of its artanh, then e^y = 2^j e^r by Taylor's
        f = (z[i] - 1.0) / (z[i] + 1.0)
        s = f * f
        p = 1.0 / 23.0
        p = p * s + 1.0 / 21.0
        p = p * s + 1.0 / 19.0
        p = p * s + 1.0 / 17.0
        p = p * s + 1.0 / 15.0
        p = p * s + 1.0 / 13.0
        p = p * s + 1.0 / 11.0
        p = p * s + 1.0 / 9.0
        p = p * s + 1.0 / 7.0
        p = p * s + 1.0 / 5.0
        p = p * s + 1.0 / 3.0
        y = exponent * (2.0 * f + 2.0 * f * s * p + whole[i] * LN2)
        j = np.int64(y * (1.0 / LN2) + 4096.5) - 4096
        r = (y - j * LN2_HIGH) - j * LN2_LOW
        q = 1.0 / 6227020800.0
        q = q * r + 1.0 / 479001600.0
        q = q * r + 1.0 / 39916800.0
        q = q * r + 1.0 / 3628800.0
        q = q * r + 1.0 / 362880.0
        q = q * r + 1.0 / 40320.0
        q = q * r + 1.0 / 5040.0
        q = q * r + 1.0 / 720.0
        q = q * r + 1.0 / 120.0
        q = q * r + 1.0 / 24.0
        q = q * r + 1.0 / 6.0
        q = q * r + 0.5
        q = q * r + 1.0
        out[i] = q * r + 1.0
        scale[i] = (j + 1023) << 52
    for i in range(n):
        out[i] *= twos[i]


@member_kernel
def largest(x: Floats) -> float:
    """The largest magnitude max |x|; 0 of none, NaN where one is NaN."""
    bits = x.view(np.int64)
    most = np.zeros(1, dtype=np.int64)
    found = np.int64(0)
    for i in range(len(x)):
        found = max(found, bits[i] & SIZE)
    most[0] = found
    return float(most.view(np.float64)[0])


@member_kernel
def primitives(z: Floats, power: float, value: Floats, room: Ints) -> None:
    """value = ((1 + z)^power - 1)/power, and its limit log(1 + z), for z > -1. room: (3, n).

    Near zero it is the series z (1 + (power-1)/2 z (1 + (power-2)/3 z (1 + ...))), which loses no digits and takes half
    the time.
    """
    n = len(z)
    if power == 1.0:
        for i in range(n):
            value[i] = z[i]
        return
    if power == -1.0:
        for i in range(n):
            value[i] = z[i] / (1.0 + z[i])
        return
    most = largest(z)
    ratio, coefficient = np.empty(MOST_TERMS), np.empty(MOST_TERMS + 1)
    for k in range(MOST_TERMS):
        ratio[k] = (power - 1.0 - k) / (2.0 + k)
    coefficient[0] = 1.0
    last, reach = 0, 1.0
    while last < MOST_TERMS and reach > NEGLIGIBLE and most < FARTHEST:
        for k in range(last, last + 4):
            coefficient[k + 1] = coefficient[k] * ratio[k]
            reach *= most * abs(ratio[k])
        last += 4
    if reach <= NEGLIGIBLE:
        for i in range(n):
            value[i] = coefficient[last]
        for k in range(last - 1, 0, -4):
            a, b, c, d = coefficient[k], coefficient[k - 1], coefficient[k - 2], coefficient[k - 3]
            for i in range(n):
                value[i] = (((value[i] * z[i] + a) * z[i] + b) * z[i] + c) * z[i] + d
        for i in range(n):
            value[i] *= z[i]
    elif power == 0.0:
        for i in range(n):
            value[i] = np.log(1.0 + z[i])
    else:
        t = np.empty(n)
        for i in range(n):
            t[i] = 1.0 + z[i]
        powers(t, power, value, room)
        for i in range(n):
            value[i] = (value[i] - 1.0) / power
