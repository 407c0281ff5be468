"""A general scene as arrays, and the same arrays packed for the way into compiled code.

Bodies are those of the case as declared, ground after them; n = 3 bodies coordinates q, what (x, y, psi) of each
has changed by since home. A
coordinate is free, or driven: known as a cubic of time within each segment; ground is driven and stands still. Rows of
joints are solved together with the accelerations (`solve_accelerations`); rows that others imply are left out there.
"""

from typing import Any, NamedTuple

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.structures import bundle
from mdstopo.scene.model import HOME, FloatArray, IndexArray

#: columns of `GeneralModel.block`; code -1 is an inerter. A block has all members of a group, or where each has a
#: parameter of its own one of them, which is number OFFSET of the group
PAIR, START, STOP, CODE, DESIGN, COUNT, GROUP, OFFSET = range(8)
#: columns of `GeneralModel.joint`
JOINT_CODE, JOINT_FIRST, JOINT_SECOND, JOINT_PAIR, JOINT_ROWS = range(5)
#: columns of `GeneralModel.response`: what is looked at, body and reference, component, order in time, group or joint
KIND, BODY, REFERENCE, COMPONENT, ORDER, SUBJECT = range(6)
#: the law code of an inerter, which is no function of elongation and rate
INERTER = -1


class GeneralModel(NamedTuple):
    """What is constant during every evaluation of one load case.

    ============  ================  =====================================================================
    free          (n,) 0 or 1       whether a coordinate is an unknown
    mass          (n,)              m, m, J of each body (1 for ground)
    q0, v0        (n,)              state at the start: what the bodies have moved since home, and velocities
    home          (n / 3, 5)        where they stand by the case (`scene.model.Model`)
    pair          (n_pair, 2)       the two bodies of each pair that members, joints or bushings connect
    reach         (n_pair,)         largest distance of an attachment point from its centre of mass, m
    block         (n_block, 8)      pair, start, stop (padded), code of the law, first design variable, count, group,
                                    number of its first member in the group
    law           (n_block, 8)      the law's parameters (`mechanics.laws.table`)
    active        (n_seg, n_block)  whether the law acts during a segment
    level         (n_seg, n_block, 2)   a tabulated force at the segment's start, and its slope
    power         (n_block,)        mu of Eq. 12
    member        (6, M_padded)     P, Q in body frames; free length l0; L^2 - l0^2 of the length L at home
    curves        (any,)            what `curve` laws read
    times         (n_seg + 1,)      start, everything that has a kink in time, end
    force         (n_seg, n, 2)     generalised load at the segment's start, slope in time; with gravity
    load_*                          loads that depend on the body's rotation, as in `scene.model.Model`
    bushing_pair  (n_bushing,)      and `bushing` (n_bushing, 12): P, Q, its stretch at home,
                                    stiffness, damping
    driven        (n_driven,)       coordinates that are driven
    drive         (n_seg, n_driven, 4)   their positions in a segment, powers of the time since its start
    joint         (n_joint, 5)      code, first and second body, pair, rows; `joint_par` (n_joint, 12)
    row           (n_joint, 3)      the place of each of its rows among the solved ones, or -1
    place         (n + n_row,)      where each coordinate, then each row, stands in the banded matrix
    size          (4,)              n_row; half width of the band; whether anything depends on velocity; entries of the
                                    joints' own matrix
    line          (n_row, 4)        of each row: where its slopes (6,) begin among those of all joints (n_joint, 3, 6),
                                    the first coordinate of each of its bodies, and where it stands in the joints' own
                                    matrix (`joint_matrix`)
    envelope      (n_row, 2)        of each place there the first place that its row reaches, and where the row would
                                    begin among the entries of all rows if it reached the place 0
    product       (n_product, 3)    what that matrix is made of: an entry, and two slopes by the same coordinate whose
                                    product, over its mass, belongs there
    steady        (size[3],)        what else it is made of: products of slopes that never change
    response      (n_resp, 6)       see the columns above; `response_par` (n_resp, 4): point
    contact_pair  (n_contact,)      the pair of edge and point; `contact` (n_contact, 11): see `mechanics.contact`
    varied        (n_varied, 4)     parameters that vary: block, place (`mechanics.laws.table`), which value, and
                                    whether it is a time that stands exactly at the start (the end); rising by value
    ============  ================  =====================================================================
    """

    free: IndexArray
    mass: FloatArray
    q0: FloatArray
    v0: FloatArray
    home: FloatArray
    pair: IndexArray
    reach: FloatArray
    block: IndexArray
    law: FloatArray
    active: IndexArray
    level: FloatArray
    power: FloatArray
    member: FloatArray
    curves: FloatArray
    times: FloatArray
    force: FloatArray
    load_body: IndexArray
    load_follows: IndexArray
    load_arm: FloatArray
    load_force: FloatArray
    bushing_pair: IndexArray
    bushing: FloatArray
    driven: IndexArray
    drive: FloatArray
    joint: IndexArray
    joint_par: FloatArray
    row: IndexArray
    place: IndexArray
    size: IndexArray
    line: IndexArray
    envelope: IndexArray
    product: IndexArray
    steady: FloatArray
    response: IndexArray
    response_par: FloatArray
    contact_pair: IndexArray
    contact: FloatArray
    varied: IndexArray


class ModelView:
    """A `GeneralModel` inside kernels, made by `unpack_general`."""

    def __init__(self, *_arrays: Any) -> None: ...


bundle(ModelView, GeneralModel._fields)


def pack_general(model: GeneralModel) -> tuple[IndexArray, FloatArray]:
    """Flat integers (sizes first) and flat floats, in the order of the fields."""
    sizes = [
        len(model.mass), len(model.pair), len(model.block), model.member.shape[1], len(model.curves),
        len(model.times) - 1, len(model.load_body), len(model.bushing_pair), len(model.driven), len(model.joint),
        len(model.place), len(model.response), len(model.contact_pair), len(model.varied),
        len(model.product),
    ]  # fmt: skip
    ints = [np.asarray(sizes, dtype=np.int64), *(each.ravel() for each in model if each.dtype.kind == "i")]
    floats = [each.ravel() for each in model if each.dtype.kind == "f"]
    return np.concatenate(ints).astype(np.int64), np.concatenate(floats).astype(np.float64)


@kernel
def unpack_general(ints, floats):
    """The `GeneralModel` whose arrays are views of the packed ones."""
    n = ints[0]
    n_pair = ints[1]
    n_block = ints[2]
    padded = ints[3]
    n_curve = ints[4]
    n_seg = ints[5]
    n_load = ints[6]
    n_bush = ints[7]
    n_driven = ints[8]
    n_joint = ints[9]
    n_place = ints[10]
    n_resp = ints[11]
    n_contact = ints[12]
    n_varied = ints[13]
    n_product = ints[14]
    i = 15
    free = ints[i : i + n]
    i += n
    pair = ints[i : i + 2 * n_pair].reshape((n_pair, 2))
    i += 2 * n_pair
    block = ints[i : i + 8 * n_block].reshape((n_block, 8))
    i += 8 * n_block
    active = ints[i : i + n_seg * n_block].reshape((n_seg, n_block))
    i += n_seg * n_block
    load_body = ints[i : i + n_load]
    i += n_load
    load_follows = ints[i : i + n_load]
    i += n_load
    bushing_pair = ints[i : i + n_bush]
    i += n_bush
    driven = ints[i : i + n_driven]
    i += n_driven
    joint = ints[i : i + 5 * n_joint].reshape((n_joint, 5))
    i += 5 * n_joint
    row = ints[i : i + 3 * n_joint].reshape((n_joint, 3))
    i += 3 * n_joint
    place = ints[i : i + n_place]
    i += n_place
    size = ints[i : i + 4]
    i += 4
    line = ints[i : i + 4 * (n_place - n)].reshape((n_place - n, 4))
    i += 4 * (n_place - n)
    envelope = ints[i : i + 2 * (n_place - n)].reshape((n_place - n, 2))
    i += 2 * (n_place - n)
    product = ints[i : i + 3 * n_product].reshape((n_product, 3))
    i += 3 * n_product
    response = ints[i : i + 6 * n_resp].reshape((n_resp, 6))
    i += 6 * n_resp
    contact_pair = ints[i : i + n_contact]
    i += n_contact
    varied = ints[i : i + 4 * n_varied].reshape((n_varied, 4))
    mass = floats[0:n]
    q0 = floats[n : 2 * n]
    v0 = floats[2 * n : 3 * n]
    f = 3 * n
    home = floats[f : f + n // 3 * HOME].reshape((n // 3, HOME))
    f += n // 3 * HOME
    reach = floats[f : f + n_pair]
    f += n_pair
    law = floats[f : f + 8 * n_block].reshape((n_block, 8))
    f += 8 * n_block
    level = floats[f : f + 2 * n_seg * n_block].reshape((n_seg, n_block, 2))
    f += 2 * n_seg * n_block
    power = floats[f : f + n_block]
    f += n_block
    member = floats[f : f + 6 * padded].reshape((6, padded))
    f += 6 * padded
    curves = floats[f : f + n_curve]
    f += n_curve
    times = floats[f : f + n_seg + 1]
    f += n_seg + 1
    force = floats[f : f + 2 * n_seg * n].reshape((n_seg, n, 2))
    f += 2 * n_seg * n
    load_arm = floats[f : f + 2 * n_load].reshape((n_load, 2))
    f += 2 * n_load
    load_force = floats[f : f + 4 * n_seg * n_load].reshape((n_seg, n_load, 2, 2))
    f += 4 * n_seg * n_load
    bushing = floats[f : f + 12 * n_bush].reshape((n_bush, 12))
    f += 12 * n_bush
    drive = floats[f : f + 4 * n_seg * n_driven].reshape((n_seg, n_driven, 4))
    f += 4 * n_seg * n_driven
    joint_par = floats[f : f + 12 * n_joint].reshape((n_joint, 12))
    f += 12 * n_joint
    steady = floats[f : f + size[3]]
    f += size[3]
    response_par = floats[f : f + 4 * n_resp].reshape((n_resp, 4))
    f += 4 * n_resp
    contact = floats[f : f + 11 * n_contact].reshape((n_contact, 11))
    return ModelView(
        free, mass, q0, v0, home, pair, reach, block, law, active, level, power, member, curves, times, force,
        load_body, load_follows, load_arm, load_force, bushing_pair, bushing, driven, drive, joint, joint_par, row,
        place, size, line, envelope, product, steady, response, response_par, contact_pair, contact, varied,
    )  # fmt: skip
