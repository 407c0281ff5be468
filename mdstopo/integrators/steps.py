"""What every integrator leaves behind, and the numbers by which it reports how it ended.

A run is m steps. Step k goes from the state k to the state k + 1 and owns the stages index[k, FIRST] up to
index[k + 1, FIRST]: states at which the force balance was imposed, with the tangents there. A stage before
index[0, FIRST] belongs to no step: it is the start. Everything that comes after (responses, reverse sweep, design
gradient) works on these: states, never members. Each integrator names its own tuple of these arrays (`FIELDS`), by
whose type its functions are found (`steps_interface`).
"""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from mdstopo.compiler.fields import Field, Fields, FloatArray, IndexArray, views_of
from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.planar_scales import add_gross_force
from mdstopo.mechanics.passes import STORED
from mdstopo.scene.springs_model import KIND, PAIR, SCALED_PRELOAD, START, STOP
from mdstopo.status import Status

#: codes that kernels return; `status_of` gives the sentence (NEEDS_ROOM never leaves the engine)
OK, NON_FINITE, STEP_LIMIT, STEP_TOO_SMALL, NEWTON_FAILED, NEEDS_ROOM, SINGULAR, CHATTERING, UNSETTLED = range(9)
#: found in the states of a run that has ended (`spatial_half_turns`)
HALF_TURN = 9

_STATUS = {
    OK: Status.OK,
    NON_FINITE: Status.NON_FINITE,
    STEP_LIMIT: Status.STEP_LIMIT,
    STEP_TOO_SMALL: Status.STEP_TOO_SMALL,
    NEWTON_FAILED: Status.NEWTON_FAILED,
    SINGULAR: Status.SINGULAR,
    CHATTERING: Status.CHATTERING,
    UNSETTLED: Status.NO_EQUILIBRIUM,
    HALF_TURN: Status.HALF_TURN,
}

#: positions in the array of work counts: states at which forces were summed, those of them with tangents, accepted
#: and rejected steps, Newton corrections, body-level iterations, reverse steps, states in design gradient passes, and,
#: in scenes of springs, members that were summed over all states
FORCES, TANGENTS, ACCEPTED, REJECTED, NEWTON, BODY_ITERATIONS, REVERSE, DESIGN, SPRINGS = range(9)
#: in general scenes, what of FORCES was not for the stages of steps: at the start and behind switches and breakpoints;
#: steps that were rejected; where within a step a member switches; samples of responses; states inside steps and
#: responses there, as at peaks
OF_STARTS, OF_REJECTED, OF_SWITCHES, OF_SAMPLES, OF_POINTS = range(9, 14)
#: of explicit methods, the accepted steps that were held short by stability (`decay_rate`); of windows of collocation
#: of general scenes those that were tried and too long for their iterations to contract
HELD_SHORT = 14
WORK = 15


def work_named(counts: Sequence[int]) -> dict[str, int]:
    """Counts of work (WORK,) by their names."""
    forces, tangents, accepted, rejected, newton, iterations, reverse, design, springs = counts[:OF_STARTS]
    starts, lost, switches, samples, points, held = counts[OF_STARTS:]
    return {
        "force_sums": forces,
        "tangents": tangents,
        "steps": accepted,
        "rejected_steps": rejected,
        "newton_corrections": newton,
        "body_iterations": iterations,
        "reverse_steps": reverse,
        "design_states": design,
        "spring_states": springs,
        "sums_of_starts": starts,
        "sums_of_rejected_steps": lost,
        "sums_of_switches": switches,
        "sums_of_samples": samples,
        "sums_of_points": points,
        "steps_held_short": held,
    }


#: a step that is longer than so many times what dampers take to damp is held short by stability, not by accuracy; the
#: explicit method of order 8 does not damp at 6.4 any more. What a motion at rest never shows, its derivatives do,
#: which then grow from step to step beyond all bounds. At STABLE, the most that is allowed, all is damped to 0.06
LIMITED, STABLE = 4.0, 5.0
#: velocities at the end of a step closer than this to those of its last stage, relative, tell no rate
TELLING = 1e-13
WORK_NAMES = tuple(work_named(range(WORK)))


@kernel
def solved_to(tolerance, fixed_step):
    """To what a linear iteration is solved: to rounding where the step is fixed, else to a part of the tolerance."""
    return 0.0 if fixed_step > 0.0 else 1e-3 * tolerance


def status_of(code: int) -> Status:
    """The `Status` that a kernel's code stands for."""
    return _STATUS[code]


class StepArrays:
    """The arrays in which the steps of a run are kept; each integrator makes a named tuple of its own from them."""

    t: Annotated[FloatArray, Field("steps + 1", "times of the states (s)")]
    state: Annotated[FloatArray, Field("steps + 1, 2, n", "q, v")]
    index: Annotated[
        IndexArray, Field("steps + 1, 3", "first stage of the step; a number of the method's own; segment of the loads")
    ]
    scalar: Annotated[FloatArray, Field("stages, 3", "t, stored energy (J), its rate (W), at each stage")]
    stage: Annotated[FloatArray, Field("stages, 3, n", "q, v, and a vector of the method's own, at each stage")]
    pull: Annotated[FloatArray, Field("stages, n_pair, 3", "E_xi, the energy's slope in the relative poses")]
    K: Annotated[FloatArray, Field("stages, n_pair, 6, 6", "-dF/dq of each pair")]
    C: Annotated[FloatArray, Field("velocity, n_pair, 6, 6", "-dF/dv, no rows where nothing is damped")]
    turn: Annotated[
        FloatArray, Field("rotation, n", "derivative of the loads by each body's angle, no rows where no load turns")
    ]


#: the arrays, and what their lengths are in terms of what `carve` is given
ARRAYS = Fields(
    StepArrays,
    {
        "velocity": "stages if damped else 0",
        "rotation": "stages if turning else 0",
    },
)
FIELDS = ARRAYS.names

#: rad that the bodies of a pair may turn against each other in an adaptive step. The error of the motion does not see
#: members that hardly move their bodies (a flywheel, a driven rotor); responses do, and turn with them.
TURN = 1.0

#: share of the longest step so far in which an error of the velocity counts at least with what it moves. A step may
#: be far shorter than the time in which the bodies move: where a member passes near zero length its force turns round
#: at once. An error of the velocity left there goes on moving them.
LASTING = 0.1

#: columns of `index`, `scalar`, `stage`; what the method's own column holds (`METHODS_OWN`): of `gauss` how many nodes,
#: as the place of its tables; of `runge_kutta` the step before; of `generalized_alpha` how many balances begin it
FIRST, METHODS_OWN, SEGMENT = range(3)
LEVEL = PARENT = STARTS = METHODS_OWN
TIME, ENERGY, ENERGY_RATE = range(3)
Q, V, OWN = range(3)


@views_of(ARRAYS, None, part)
def carve(floats, ints, n, n_pair, steps, stages, damped, turning):
    """The arrays of `StepArrays` with room for so many steps and stages, as views of flat arrays.

    floats, ints: the flat arrays, at least as long as `room_for` says.
    n, n_pair: coordinates, and pairs of bodies.
    steps, stages: how many there is to be room for.
    damped: whether any force depends on velocity: no rows of C otherwise.
    turning: whether loads turn: no rows of turn otherwise.
    """


def room_for(n: int, n_pair: int, steps: int, stages: int, damped: bool, turning: bool) -> tuple[int, int]:
    """Lengths of the flat arrays of floats and of integers that `carve` needs.

    n, n_pair: coordinates, and pairs of bodies.
    steps, stages: how many there is to be room for.
    damped: whether any force depends on velocity.
    turning: whether loads turn.
    """
    return ARRAYS.lengths(n=n, n_pair=n_pair, steps=steps, stages=stages, damped=damped, turning=turning)


# Numba's own assignment of an array to a slice brings code that formats its error messages into every kernel: seconds
# of compilation. Hence these, and `planar_poses.copy_rows`.


@part
def copy_tangents(source, target):
    """Copy tangents (n_pair, 6, 6): target = source."""
    for p in range(source.shape[0]):
        for i in range(6):
            for j in range(6):
                target[p, i, j] = source[p, i, j]


@part
def keep_state(times, state, k, t, q, v):
    """Keep a state between two steps.

    In:
      k: its number.
      t: time (s).
      q, v (n,): coordinates and velocities.
    Out:
      times (steps + 1,), state (steps + 1, 2, n): of which entry k is written.
    """
    times[k] = t
    for d in range(state.shape[2]):
        state[k, Q, d] = q[d]
        state[k, V, d] = v[d]


@kernel
def step_at(times, count, t):
    """The step that holds time t: the last one that begins before it."""
    low = 0
    high = count - 1
    while low < high:
        middle = (low + high + 1) // 2
        if times[middle] < t:
            low = middle
        else:
            high = middle - 1
    return low


@part
def keep_stage(o, t, q, v, own, rel, sums, k, c, turn, scalar, stage, pull, k_out, c_out, turn_out):
    """Keep what the force balance of a stage saw: its state, sums and tangents.

    In:
      o: number of the stage.
      t: time (s).
      q, v (n,): coordinates and velocities.
      own (n,): a vector of the method's own.
      rel (n_pair, POSE), sums (n_pair, SUMS): relative poses, and sums of the members there.
      k, c (n_pair, 6, 6): tangents of each pair; c is read where C has rows.
      turn (n,): derivative of the loads by the angle of their body, read where turn_out has rows.
    Out:
      scalar, stage, pull, k_out, c_out, turn_out: arrays of the steps, of which row o is written.
    """
    energy = 0.0
    rate = 0.0
    for p in range(rel.shape[0]):
        energy += sums[p, STORED]
        for j in range(3):
            rate += sums[p, 4 + j] * rel[p, 4 + j]
            pull[o, p, j] = sums[p, 4 + j]
        for i in range(6):
            for j in range(6):
                k_out[o, p, i, j] = k[p, i, j]
                if c_out.shape[0] > 0:
                    c_out[o, p, i, j] = c[p, i, j]
    for d in range(stage.shape[2]):
        stage[o, 0, d] = q[d]
        stage[o, 1, d] = v[d]
        stage[o, 2, d] = own[d]
        if turn_out.shape[0] > 0:
            turn_out[o, d] = turn[d]
    scalar[o, TIME] = t
    scalar[o, ENERGY] = energy
    scalar[o, ENERGY_RATE] = rate


@part
def add_preloads(model, strength, rel, out):
    """out (n,) += the preloads of all springs, strength (3, M_padded), as gross forces."""
    for k in range(model.block.shape[0]):
        total = 0.0
        if model.block[k, KIND] == 1:
            for i in range(model.block[k, START], model.block[k, STOP]):
                total += abs(strength[SCALED_PRELOAD, i])
        if total > 0.0:
            add_gross_force(model.pair, rel, model.reach, model.block[k, PAIR], total, out)


@part
def lasting(h, longest):
    """The factor by which the error of a step of length h is multiplied where its error of velocity lasts; longest: the
    longest step so far."""
    return max(1.0, LASTING * longest / h)


@kernel
def decay_rate(mass, a, last_a, v, last_v):
    """The rate at which dampers damp (1/s), as the two states tell that an explicit step has at its end; 0: none.

    The step's last stage and the state itself differ by its error, in which the fastest decay is largest:
    |a - a'| / |v - v'| is its rate (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.2).

    mass (n,): masses and moments of inertia (kg, kg m^2); 0 of what is driven.
    a, last_a (n,): accelerations of the state, and of the last stage.
    v, last_v (n,): their velocities.
    """
    forces = 0.0
    speeds = 0.0
    whole = 0.0
    for d in range(mass.shape[0]):
        change = a[d] - last_a[d]
        forces += mass[d] * change * change
        change = v[d] - last_v[d]
        speeds += mass[d] * change * change
        whole += mass[d] * v[d] * v[d]
    return np.sqrt(forces / speeds) if speeds > TELLING * TELLING * whole else 0.0
