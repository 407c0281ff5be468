"""Bushings between bodies in a plane: u = d + R q - p and theta against springs and dampers along the axes of A."""

from mdstopo.compiler.jit import kernel


@kernel
def add_bushings(model, rel, q, tangent, sums):
    """Q, K and C of the bushings; see `kinematics_interface.add_bushings`."""
    for j in range(model.bushing_pair.shape[0]):
        b = model.bushing[j]
        p = model.bushing_pair[j]
        r = rel[p]
        o = sums[p]
        ax = r[2] * b[2] - r[3] * b[3]
        ay = r[3] * b[2] + r[2] * b[3]
        ux = b[4] + r[10] + (r[12] * b[2] - r[13] * b[3])
        uy = b[5] + r[11] + (r[13] * b[2] + r[12] * b[3])
        wx = r[4] - ay * r[6]
        wy = r[5] + ax * r[6]
        fx = b[6] * ux + b[9] * wx
        fy = b[7] * uy + b[10] * wy
        turn = q[3 * model.pair[p, 1] + 2] - q[3 * model.pair[p, 0] + 2]
        o[0] -= fx
        o[1] -= fy
        o[2] -= ax * fy - ay * fx + b[8] * turn + b[11] * r[6]
        if not tangent:
            continue
        # g = d(u)/dxi = [I, (-ay, ax)]; K = g^T k g + g^T c d(w)/dxi + (d2u/dtheta2 . f), C = g^T c g
        kxt = -b[6] * ay - b[9] * ax * r[6]
        kyt = b[7] * ax - b[10] * ay * r[6]
        o[7] += b[6]
        o[9] += kxt
        o[11] += b[7]
        o[12] += kyt
        o[13] -= ay * b[6]
        o[14] += ax * b[7]
        o[15] += ax * kyt - ay * kxt - (ax * fx + ay * fy) + b[8]
        o[16] += b[9]
        o[18] += b[10]
        o[19] -= b[9] * ay
        o[20] += b[10] * ax
        o[21] += b[9] * ay * ay + b[10] * ax * ax + b[11]
