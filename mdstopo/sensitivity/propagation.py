"""Sensitivities of all members carried through one linear map: what `springs_direct` does a step.

A step is a linear map of the changes of its start (D numbers: q, v and what the method carries) and of the force that
each member adds at its stages. The map is found at body level by pushing unit changes through the integrator's
tangent step; one pass over the members then applies it to all of them,

    dS_i <- A dS_i + sum over stages W_s (T^T b f)_i

(f at unit strength). S is stored by state, members along the rows: (D, M_padded).
"""

import numpy as np

from mdstopo.compiler.jit import kernel, member_kernel
from mdstopo.integrators.steps import FIRST
from mdstopo.integrators.steps_interface import carried, tangent_step
from mdstopo.mechanics.kinematics.planar_poses import POSE, add_pair_force, relative_pose
from mdstopo.mechanics.laws.spring import elastic_design, viscous_design
from mdstopo.scene.springs_model import (
    DAMPING,
    DESIGN,
    EXCESS,
    KIND,
    L0,
    PAIR,
    PRELOAD,
    PX,
    PY,
    QX,
    QY,
    START,
    STIFFNESS,
    STOP,
)

#: members that are carried through together: their rows stay in the first-level cache
STRIP = 128


@kernel
def step_matrix(pair, home, inv_mass, tables, steps, w, c, mu_q, bar, damped, turning, matrix):
    """The linear map of a step, from its start to its end or to a point in it (D = n (2 + what the method carries)).

    Columns: changes of the start; then for each stage and pair the three entries of b f of a member there.
    Rows: changes of the end; last the change of mu_q . q at the end plus that of bar_s . q_s at the stages.

    Constant:
      pair (n_pair, 2): the bodies of each pair.
      home (n_body, HOME): where bodies are when q is zero.
      inv_mass (n,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      tables: constant arrays of the integrator.
    In:
      steps: what the integrator kept.
      w: number of the step.
      c: fraction of it up to which; negative: to its end.
      mu_q (n,), bar (s, n): weights of the coordinates in the last row.
      damped: whether any force depends on velocity.
      turning: whether loads turn.
    Out:
      matrix (D + 1 or more, D + 3 n_pair s or more): overwritten.
    """
    n = inv_mass.shape[0]
    n_pair = pair.shape[0]
    rows = carried(steps)
    width = (2 + rows) * n
    o = steps.index[w, FIRST]
    s = steps.index[w + 1, FIRST] - o
    y = np.empty(width)
    force = np.zeros((s, n))
    moved = np.empty((s, n))
    rel = np.empty((n_pair, POSE))
    dx = y[2 * n :].reshape((rows, n))
    for j in range(width + 3 * n_pair * s):
        y[:] = 0.0
        stage = 0
        if j < width:
            if inv_mass[j % n] == 0.0:
                for i in range(width + 1):
                    matrix[i, j] = 0.0
                continue
            y[j] = 1.0
        else:
            stage = (j - width) // (3 * n_pair)
            p = (j - width) // 3 % n_pair
            axis = (j - width) % 3
            if p == 0 and axis == 0:
                relative_pose(pair, home, steps.stage[o + stage, 0], steps.stage[o + stage, 1], rel)
            # a member's generalised force is -T^T b f
            unit = -1.0
            add_pair_force(
                pair, rel, p, unit if axis == 0 else 0.0, unit if axis == 1 else 0.0, unit if axis == 2 else 0.0,
                force[stage],
            )  # fmt: skip
        tangent_step(pair, inv_mass, tables, steps, w, c, y[:n], y[n : 2 * n], dx, force, moved, damped, turning)
        value = 0.0
        for d in range(n):
            value += mu_q[d] * y[d]
            for i in range(s):
                value += bar[i, d] * moved[i, d]
        for i in range(width):
            matrix[i, j] = y[i]
        matrix[width, j] = value
        for d in range(n):
            force[stage, d] = 0.0


@member_kernel
def add_three(a, b, c, x, y, z, out):
    """out += a x + b y + c z, members along the rows.

    a, b, c: numbers.
    x, y, z, out (m,): rows.
    """
    for i in range(out.shape[0]):
        out[i] += a * x[i] + b * y[i] + c * z[i]


@kernel
def apply_matrix(pair, home, block, member, stage, s, matrix, first, last, adding, S, target):
    """Carry the derivatives of all design members through the linear map of a step.

    Constant:
      pair (n_pair, 2): the bodies of each pair.
      home (n_body, HOME): where bodies are when q is zero.
      block (n_block, BLOCK), member (MEMBER, M_padded): as of `Model`.
    In:
      stage (s, 3, n): of the step's stages, of which q and v are read.
      s: how many stages.
      matrix: of `step_matrix`.
      first, last: its rows from first to before last are multiplied.
      adding: whether the products are added to what is there.
      S (D, M_padded): derivatives at the start by alpha^mu.
    Out:
      target (last - first, M_padded): rows of matrix times S and the members' forces; it may be S itself.
    """
    n_pair = pair.shape[0]
    width = S.shape[0]
    rel = np.empty((s, n_pair, POSE))
    for i in range(s):
        relative_pose(pair, home, stage[i, 0], stage[i, 1], rel[i])
    unit = np.eye(3)
    push = np.empty((3 * s, STRIP))
    fresh = np.empty((last - first, STRIP))
    for k in range(block.shape[0]):
        if block[k, DESIGN] < 0:
            continue
        p = block[k, PAIR]
        for lo in range(block[k, START], block[k, STOP], STRIP):
            hi = min(lo + STRIP, block[k, STOP])
            wide = hi - lo
            px = member[PX, lo:hi]
            py = member[PY, lo:hi]
            qx = member[QX, lo:hi]
            qy = member[QY, lo:hi]
            l0 = member[L0, lo:hi]
            excess = member[EXCESS, lo:hi]
            ks = member[STIFFNESS, lo:hi]
            cs = member[DAMPING, lo:hi]
            ps = member[PRELOAD, lo:hi]
            for i in range(3 * s):
                axis = i % 3
                o = push[i, :wide]
                o[:] = 0.0
                if block[k, KIND] == 0:
                    elastic_design(
                        px, py, qx, qy, l0, excess, ks, rel[i // 3 : i // 3 + 1, p], unit[axis : axis + 1], o
                    )
                else:
                    viscous_design(px, py, qx, qy, l0, excess, ks, cs, ps, rel[i // 3, p], unit[axis], o)
            for i in range(first, last):
                o = fresh[i - first, :wide]
                for g in range(wide):
                    o[g] = target[i - first, lo + g] if adding else 0.0
                for group in range(width // 3 + s):
                    if group < width // 3:
                        j = 3 * group
                        x = S[j, lo:hi]
                        y = S[j + 1, lo:hi]
                        z = S[j + 2, lo:hi]
                    else:
                        own = 3 * group - width
                        j = width + own * n_pair + 3 * p
                        x = push[own, :wide]
                        y = push[own + 1, :wide]
                        z = push[own + 2, :wide]
                    if matrix[i, j] != 0.0 or matrix[i, j + 1] != 0.0 or matrix[i, j + 2] != 0.0:
                        add_three(matrix[i, j], matrix[i, j + 1], matrix[i, j + 2], x, y, z, o)
            for i in range(last - first):
                for g in range(wide):
                    target[i, lo + g] = fresh[i, g]
