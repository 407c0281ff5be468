"""The springs for SciPy, compiled by Numba: forces, their reverse, energy, as a user of SciPy would write them."""

from typing import Any

import numba
import numpy as np

_compiled = numba.njit(fastmath=True, error_model="numpy")


@_compiled
def forces(x: Any, groups: Any, first: Any, p: Any, q: Any, length: Any, stiffness: Any, out: Any) -> None:
    """out (3 B): what the springs do to the bodies at x (3 B); p, q (2, N)."""
    out[:] = 0.0
    for g in range(groups.shape[0]):
        a, b = 3 * groups[g, 0], 3 * groups[g, 1]
        c1, s1, c2, s2 = np.cos(x[a + 2]), np.sin(x[a + 2]), np.cos(x[b + 2]), np.sin(x[b + 2])
        dx, dy = x[b] - x[a], x[b + 1] - x[a + 1]
        fx, fy, ma, mb = 0.0, 0.0, 0.0, 0.0
        for i in range(first[g], first[g + 1]):
            ax, ay = c1 * p[0, i] - s1 * p[1, i], s1 * p[0, i] + c1 * p[1, i]
            bx, by = c2 * q[0, i] - s2 * q[1, i], s2 * q[0, i] + c2 * q[1, i]
            ex, ey = dx + bx - ax, dy + by - ay
            share = stiffness[i] * (1.0 - length[i] / np.sqrt(ex * ex + ey * ey))
            ex *= share
            ey *= share
            fx += ex
            fy += ey
            ma += ax * ey - ay * ex
            mb += bx * ey - by * ex
        out[a] += fx
        out[a + 1] += fy
        out[a + 2] += ma
        out[b] -= fx
        out[b + 1] -= fy
        out[b + 2] -= mb


@_compiled
def reverse(
    x: Any, u: Any, groups: Any, first: Any, p: Any, q: Any, length: Any, stiffness: Any,
    weight: float, out: Any, slopes: Any,
) -> None:  # fmt: skip
    """out (3 B) = slope of forces . u by x; or, with slopes (N,), those += weight * slope by stiffness."""
    out[:] = 0.0
    for g in range(groups.shape[0]):
        a, b = 3 * groups[g, 0], 3 * groups[g, 1]
        c1, s1, c2, s2 = np.cos(x[a + 2]), np.sin(x[a + 2]), np.cos(x[b + 2]), np.sin(x[b + 2])
        dx, dy, ux, uy = x[b] - x[a], x[b + 1] - x[a + 1], u[b] - u[a], u[b + 1] - u[a + 1]
        wa, wb = u[a + 2], u[b + 2]
        fx, fy, ma, mb = 0.0, 0.0, 0.0, 0.0
        if slopes.shape[0] > 0:
            for i in range(first[g], first[g + 1]):
                ax, ay = c1 * p[0, i] - s1 * p[1, i], s1 * p[0, i] + c1 * p[1, i]
                bx, by = c2 * q[0, i] - s2 * q[1, i], s2 * q[0, i] + c2 * q[1, i]
                ex, ey = dx + bx - ax, dy + by - ay
                along = ex * (ux - wb * by + wa * ay) + ey * (uy + wb * bx - wa * ax)
                slopes[i] -= weight * (1.0 - length[i] / np.sqrt(ex * ex + ey * ey)) * along
            continue
        for i in range(first[g], first[g + 1]):
            ax, ay = c1 * p[0, i] - s1 * p[1, i], s1 * p[0, i] + c1 * p[1, i]
            bx, by = c2 * q[0, i] - s2 * q[1, i], s2 * q[0, i] + c2 * q[1, i]
            ex, ey = dx + bx - ax, dy + by - ay
            vx, vy = ux - wb * by + wa * ay, uy + wb * bx - wa * ax
            inverse = 1.0 / np.sqrt(ex * ex + ey * ey)
            share = stiffness[i] * (1.0 - length[i] * inverse)
            along = stiffness[i] * length[i] * inverse * inverse * inverse * (ex * vx + ey * vy)
            gx, gy = -share * vx - along * ex, -share * vy - along * ey
            fx += gx
            fy += gy
            ma += ay * gx - ax * gy - wa * share * (ex * ax + ey * ay)
            mb += bx * gy - by * gx + wb * share * (ex * bx + ey * by)
        out[a] -= fx
        out[a + 1] -= fy
        out[a + 2] += ma
        out[b] += fx
        out[b + 1] += fy
        out[b + 2] += mb


@_compiled
def energy(x: Any, groups: Any, first: Any, p: Any, q: Any, length: Any, stiffness: Any, slopes: Any) -> float:
    """Energy of the springs; slopes (N,): its slope by stiffness."""
    whole = 0.0
    for g in range(groups.shape[0]):
        a, b = 3 * groups[g, 0], 3 * groups[g, 1]
        c1, s1, c2, s2 = np.cos(x[a + 2]), np.sin(x[a + 2]), np.cos(x[b + 2]), np.sin(x[b + 2])
        dx, dy = x[b] - x[a], x[b + 1] - x[a + 1]
        for i in range(first[g], first[g + 1]):
            ex = dx + c2 * q[0, i] - s2 * q[1, i] - c1 * p[0, i] + s1 * p[1, i]
            ey = dy + s2 * q[0, i] + c2 * q[1, i] - s1 * p[0, i] - c1 * p[1, i]
            stretch = np.sqrt(ex * ex + ey * ey) - length[i]
            slopes[i] = 0.5 * stretch * stretch
            whole += stiffness[i] * slopes[i]
    return whole
