"""From what members add up to, to the sums of a pair of bodies (`passes.SUMS`)."""

from mdstopo.compiler.jit import part
from mdstopo.compiler.vector import total


@part
def upper_triangle(xx, xy, yy, xt, yt, tt, w, wx, wy):
    """xx, xy, yy, xt, yt, tt of K, summed from vectors.

    xx, xy, yy, xt, yt, tt: the entries without what is alike in all laws.
    w: sum of f/L (N/m).
    wx, wy: sum of that times a = R q (N).
    """
    whole = total(w)
    return (
        total(xx) + whole,
        total(xy),
        total(yy) + whole,
        total(xt) - total(wy),
        total(yt) + total(wx),
        total(tt),
    )


@part
def add_forces(found, counted, out):
    """Add Q and E of undamped springs to out (SUMS,); counted: whether theirs is part of the stored energy."""
    for i in range(3):
        out[i] += found[i]
    if counted:
        out[3] += found[3]
        for i in range(3):
            out[4 + i] -= found[i]


@part
def add_tangent(found, out):
    """Add the upper triangle xx, xy, yy, xt, yt, tt of K to out (SUMS,)."""
    kxx, kxy, kyy, kxt, kyt, ktt = found
    out[7] += kxx
    out[8] += kxy
    out[9] += kxt
    out[10] += kxy
    out[11] += kyy
    out[12] += kyt
    out[13] += kxt
    out[14] += kyt
    out[15] += ktt
