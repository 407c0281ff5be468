"""What the derivatives of many rows by the design gather at the stages of one step: `gather.add_designs` for all.

Rows differ in their virtual displacements alone. So poses, directions and forces of members are formed once, and every
row multiplies them with its own.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.compiler.vector import lanes
from mdstopo.general.design.balance_slopes import add_numbers_of_rows
from mdstopo.general.design.gather import poses_of_stages
from mdstopo.general.design.parameters import parameter_slopes
from mdstopo.general.dynamics.forces import inerter_force
from mdstopo.general.dynamics.members import SCALE, level_of, rate_of_row
from mdstopo.general.model.general_model import (
    CODE,
    COUNT,
    DESIGN,
    INERTER,
    PAIR,
    START,
    VARIED_BLOCK,
    VARIED_FIRST,
    VARIED_PLACE,
    VARIED_STOP,
    VARIED_VALUE,
)
from mdstopo.general.model.strides import pair_freedoms
from mdstopo.general.model.switches import carriers
from mdstopo.integrators.steps import DESIGN as DESIGN_STATES
from mdstopo.mechanics.kinematics.kinematics_interface import (
    freedoms,
    member_designs_of_rows,
    pair_displacement,
    spring_designs_of_rows,
)
from mdstopo.mechanics.laws.law_table import FREE_LENGTH, SPRING


@kernel
def add_designs_of_rows(model, segment, history, o, stages, member_state, z, out, work):
    """Add the derivatives by the design of many rows at the stages of one step: `gather.add_designs` for all of them.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      segment: number of the stretch of time between two breakpoints.
      o, stages: number of the first stage, and how many there are.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      z (R, 17, n): virtual displacements of each row at each stage.
    Out:
      out (R, M_padded + P): derivatives by alpha^mu and values of each row, added to.
      work (WORK,): counts of work, added to.
    """
    count = z.shape[0]
    n_pair = model.pair.shape[0]
    rel = poses_of_stages(model, history, o, stages)
    u = np.empty((count, stages, n_pair, freedoms(model)))
    changes_of_pairs(model, rel, z, u)
    add_members_of_rows(model, segment, history, o, member_state, rel, u, out, work)
    for k in range(model.block.shape[0]):
        if model.block[k, CODE] == INERTER and model.block[k, DESIGN] >= 0 and model.active[segment, k] != 0:
            for j in range(stages):
                _add_inerters(model, k, history, o + j, z, j, out)
    if model.varied.shape[0] > 0:
        for j in range(stages):
            _add_parameters(model, segment, history, o + j, member_state, z, j, out)
    if model.apart.shape[0] > 0:
        for j in range(stages):
            add_numbers_of_rows(model, segment, history, o + j, z, j, out)


@kernel
def changes_of_pairs(model, rel, z, u):
    """What virtual displacements do to the relative poses of pairs that carry more than joints, with the sign turned.

    model: the compiled scene.
    rel (S, n_pair, POSE): relative poses at S states. z (R, S or more, n): virtual displacements there, of R rows.
    u (R, S, n_pair, D): out, -T z.
    """
    carries = carriers(model)
    for j in range(rel.shape[0]):
        for p in range(rel.shape[1]):
            if carries[p] != 0:
                for m in range(u.shape[0]):
                    pair_displacement(model, rel[j], p, z[m, j], u[m, j, p])
                    for i in range(freedoms(model)):
                        u[m, j, p, i] = -u[m, j, p, i]


@kernel
def add_members_of_rows(model, segment, history, o, member_state, rel, u, out, work):
    """Add the derivatives by alpha^mu of all design members but inerters at the stages of one step: sum f (b . u).

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      segment, o: number of the stretch of time between two breakpoints, and of the first stage.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      rel (S, n_pair, POSE): relative poses at the stages.
      u (R, S or more, n_pair, D): virtual changes of these for each row, with their signs turned.
    Out:
      out (R, M_padded or more): derivatives by alpha^mu of each row, added to.
      work (WORK,): counts of work, added to.
    """
    stages = rel.shape[0]
    work[DESIGN_STATES] += stages * u.shape[0]
    room = np.empty(4 * stages * lanes())
    longest = 0
    for k in range(model.block.shape[0]):
        longest = max(longest, model.block[k, COUNT])
    seen = np.empty((freedoms(model) + 2, longest))
    for k in range(model.block.shape[0]):
        code = model.block[k, CODE]
        if model.block[k, DESIGN] < 0 or model.active[segment, k] == 0 or code == INERTER:
            continue
        p = model.block[k, PAIR]
        lo = model.block[k, START]
        if code == SPRING:
            spring_designs_of_rows(model, model.law[k], lo, model.block[k, COUNT], rel, u, p, room, out)
            continue
        for j in range(stages):
            t = history.when[o + j]
            level = level_of(model, segment, k, t)
            member_designs_of_rows(
                model, code, model.law[k], lo, model.block[k, COUNT], t, level, member_state, rel[j, p], u, j, p, seen,
                out,
            )  # fmt: skip


@kernel
def _add_inerters(model, k, history, at, z, j, out):
    """Add the derivatives by alpha^mu of the inerters of block k at one stage.

    model: the compiled scene.
    k: the block.
    history, at: the history of steps (`StepHistory`), and the number of the stage.
    z (R, 17, n): virtual displacements of each row at each stage.
    j: the stage, counted from the first of the step.
    out (R, M_padded + P): added to.
    """
    row = np.empty(pair_freedoms(model))
    for i in range(model.block[k, START], model.block[k, START] + model.block[k, COUNT]):
        f = inerter_force(model, k, i, history.stage_q[at], history.stage_v[at], history.stage_a[at], row)
        for m in range(out.shape[0]):
            out[m, i] -= f * rate_of_row(model, model.block[k, PAIR], row, z[m, j])


@kernel
def _add_parameters(model, segment, history, at, member_state, z, j, out):
    """Add the derivatives by the laws' parameters at one stage: `parameters.add_parameters` of rows, without energy.

    model: the compiled scene.
    segment: number of the stretch of time between two breakpoints.
    history, at: the history of steps (`StepHistory`), and the number of the stage.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    z (R, 17, n): virtual displacements of each row at each stage.
    j: the stage, counted from the first of the step.
    out (R, M_padded + P): added to behind the members.
    """
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    moved = np.empty(pair_freedoms(model))
    total = np.empty(out.shape[0])
    members = model.member.shape[1]
    for e in range(model.varied.shape[0]):
        k = model.varied[e, VARIED_BLOCK]
        if model.varied[e, VARIED_PLACE] > FREE_LENGTH or model.active[segment, k] == 0:
            continue
        p = model.block[k, PAIR]
        total[:] = 0.0
        for i in range(model.varied[e, VARIED_FIRST], model.varied[e, VARIED_STOP]):
            slope, _ = parameter_slopes(
                model, e, i, segment, history.when[at], member_state, history.stage_q[at], history.stage_v[at],
                history.stage_a[at], row, row_rate, moved,
            )  # fmt: skip
            for m in range(out.shape[0]):
                total[m] -= member_state[SCALE, i] * (slope * rate_of_row(model, p, row, z[m, j]))
                if model.varied[e, VARIED_PLACE] < 0:
                    total[m] -= member_state[SCALE, i] * rate_of_row(model, p, moved, z[m, j])
        for m in range(out.shape[0]):
            out[m, members + model.varied[e, VARIED_VALUE]] += total[m]
