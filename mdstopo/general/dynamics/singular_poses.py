"""Steps over poses at which joints repeat each other for an instant, as a linkage does that is stretched out.

Along a motion the smallest singular value sigma of the joints' scaled slopes Phi_q falls in proportion to the distance
from such a pose, and rises behind it. Beside it everything is determined: accelerations are off by rounding, or by what
a stage is off, over sigma. In it several motions are possible (a four-bar that lies flat may go on as a parallelogram
or crossed), and nothing that is computed there tells which one is meant. So no step ends near such a pose, and none has
a stage there: a step goes from well before it to well behind it, and its state, which is moved onto the joints by no
more than its error, stays on the branch that it was on.

What a step across the pose is off by is nearly all across the joints: a stage that is off by epsilon has accelerations
that are off by epsilon over sigma. The joints take that away at the step's end. So there the error of a step is what is
left along the joints (`error_along`), as long as the rest is far too small to lead to another branch.

sigma of two states tells where it will vanish. A pose that cannot be passed, where a linkage locks, rejects every step
across it; then steps become shorter until the joints count as singular.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_unknowns
from mdstopo.general.dynamics.joint_matrix import growth
from mdstopo.general.model.switches import OF_JOINTS

#: a step may not end where sigma is less than this share of what it was at its begin
LEAST_SIGMA_LEFT = 0.1
#: share of the largest sigma so far below which a pose is looked out for, and below which steps have to cross it
WATCHED_SIGMA, CROSSED_SIGMA = 0.25, 0.02
#: a step that would end nearly there ends at this share of the way
BEFORE = 0.6
#: how far a step across a pose goes at least and, where it has to cross it, at most, as multiples of the way to it
SHORTEST_CROSSING, LONGEST_CROSSING = 1.5, 3.0
#: lengths of a step that are tried
TRIED = 32
#: error of a step across a pose, relative to the motion and to sigma at its end, that cannot lead to another branch
SAFE = 1e-3


@kernel
def least_singular_value(model, workspace):
    """An estimate of sigma, at the state whose joints were factorised last in the workspace.

    1 where it is not known: where the factors there are not those of the joints' matrix, or there are no joints.
    """
    if workspace.switches[OF_JOINTS] == 0 or model.skyline.shape[0] == 0:
        return 1.0
    size, _ = growth(model.skyline, workspace.gram, workspace.diagonal, workspace.x)
    return np.sqrt(model.skyline.shape[0] / size) if size > 0.0 else 1.0


@kernel
def way_to_pose(h, before, now, largest):
    """The time until sigma vanishes, from its values `before` and `now` at a distance h; infinite where it may not
    vanish."""
    if not now < before or now > WATCHED_SIGMA * largest:
        return np.inf
    return h * now / (before - now)


@kernel
def step_beside(h, way, must, nodes, s):
    """A step of about h that does not end, and has no stage, near the singular pose that is `way` ahead.

    must: whether it has to cross the pose, however short h is; nodes (s,): where its stages are.
    """
    if not must:
        if way > 2.0 * h:
            return h
        if h < SHORTEST_CROSSING * way:
            return min(h, BEFORE * way)
    most = LONGEST_CROSSING if must else h / way
    least = SHORTEST_CROSSING if must else max(SHORTEST_CROSSING, 0.7 * most)
    best = -1.0
    found = most
    for i in range(TRIED):
        multiple = most - (most - least) * i / (TRIED - 1)
        at = 1.0 / multiple
        gap = 1.0 - at
        for j in range(s):
            gap = min(gap, abs(nodes[j] - at))
        if gap > best:
            best = gap
            found = multiple
    return found * way


@kernel
def crosses(h, way):
    """Whether a step of length h goes across the pose that is `way` ahead, as `step_beside` means it to."""
    return h > 0.99 * SHORTEST_CROSSING * way


@kernel
def error_along(model, workspace, vectors, s, h, a, weight, whole, sigma):
    """Estimated error of a step across a pose without its part across the joints, relative to the motion.

    Constant:
      model: the compiled scene.
      vectors (7 or more, 17): C, BB, B, E_Q, E_V, E2_Q, E2_V of the method (`integrators.runge_kutta_tables`).
      s: number of its stages.
    In:
      workspace: workspace with the factors of the joints' matrix at the end of the step.
      h: length of the step (s).
      a (s or more, n): accelerations at its stages (m/s^2, rad/s^2).
      weight (n,): weights of the coordinates (1/m, 1/rad; `kinematics_interface.motion_weights`).
      whole: the whole error (`integrators.springs_runge_kutta.step_error`).
      sigma: least singular value of the joints at the end of the step.

    Returns `whole` where that is large enough to lead to another branch.
    """
    if not whole < SAFE * sigma:
        return whole
    n = weight.shape[0]
    rows = np.empty(model.size[0])
    off = np.empty(n)
    size = np.zeros(4)
    for m in range(4):
        for d in range(n):
            value = 0.0
            for j in range(s):
                value += vectors[3 + m, j] * a[j, d]
            off[d] = model.mass[d] * value
        rows[:] = 0.0
        solve_unknowns(model, workspace, off, rows)
        for d in range(n):
            size[m] = max(size[m], h * h * weight[d] * abs(off[d]))
    worst = max(size[0], size[1])
    coarse = max(size[2], size[3])
    if coarse > 0.0 and worst > 0.0:  # as in `integrators.springs_runge_kutta.step_error`
        worst = worst * worst / np.sqrt(worst * worst + 0.01 * coarse * coarse)
    return worst
