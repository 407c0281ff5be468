"""A general scene as arrays, and the same arrays packed for the way into compiled code.

Bodies are those of the case as declared, ground after them. How many numbers each has, its kinematics says
(`mechanics.kinematics`): n freedoms of all bodies, and n_q coordinates q, what has changed since home. A freedom is
free, or driven: known as a function of time within each segment; ground is driven and stands still. Rows of joints are
solved together with the accelerations (`solve_accelerations`); rows that others imply are left out there.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np

from mdstopo.compiler.fields import Field, Fields, views_of
from mdstopo.compiler.jit import by_type, kernel
from mdstopo.general.model.bundles import bundle
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics, move_by
from mdstopo.mechanics.kinematics.planar import PLANAR
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.scene.springs_model import (
    FloatArray,
    Force,
    IndexArray,
    LoadArm,
    LoadBody,
    LoadFollows,
    LoadForce,
    Power,
    Reach,
    StartVelocities,
)

#: columns of `GeneralModel.block`; code -1 is an inerter. A block has all members of a group, or where each has a
#: parameter of its own one of them, which is number OFFSET of the group. Where every point of one grid is joined with
#: every point of another, ROW members behind each other begin at one point, -ROW where that is too few for kernels of
#: rows (`scene.grid_members`); elsewhere ROW is 0
PAIR, START, STOP, CODE, DESIGN, COUNT, GROUP, OFFSET, ROW = range(9)
#: columns of `GeneralModel.joint`
JOINT_CODE, JOINT_FIRST, JOINT_SECOND, JOINT_PAIR, JOINT_ROWS = range(5)
#: columns of `GeneralModel.response`: its kind, body and reference, component, order in time, group or joint
KIND, BODY, REFERENCE, COMPONENT, ORDER, SUBJECT = range(6)
#: columns of `GeneralModel.varied`: the block, the parameter's place in its law or the end that moves, which value,
#: whether a time at an end, and the members (padded) from the first to the one behind the last
VARIED_BLOCK, VARIED_PLACE, VARIED_VALUE, VARIED_END, VARIED_FIRST, VARIED_STOP, VARIED_COLUMNS = range(7)
#: what stands in the place of a parameter's place where an end of a member moves, on the pair's first or second body
FIRST_END, SECOND_END = -1, -2
#: the column of `GeneralModel.along` behind the direction
ALONG_FREE_LENGTH = -1
#: rows of `GeneralModel.member` behind the ends in body frames (counted from the last)
MEMBER_FREE_LENGTH, MEMBER_EXCESS = -2, -1
#: the law code of an inerter, which is no function of elongation and rate
INERTER = -1
#: codes (column KIND) of the two responses that depend on the design at fixed motion: stored energy, forces of members
ENERGY, MEMBER_FORCE = 0, 3


class GeneralModel(NamedTuple):
    """What is constant during every evaluation of one load case."""

    free: Annotated[IndexArray, Field("n", "1 where a freedom is an unknown, 0 where it is driven")]
    mass: Annotated[FloatArray, Field("n", "mass (kg) or inertia (kg m²) of each freedom; 1 of ground")]
    q0: Annotated[FloatArray, Field("n_q", "coordinates at the start: moved since home")]
    v0: StartVelocities
    home: Annotated[
        FloatArray,
        Field("n_body, n_home", "where each body is at q = 0 (m, rad), and what is known of its attitude there"),
    ]
    pair: Annotated[IndexArray, Field("n_pair, 2", "the two bodies that members, joints or bushings connect")]
    reach: Reach
    block: Annotated[
        IndexArray,
        Field(
            "n_block, 9",
            "pair, start, stop (padded), code of the law, first design variable, members, group, number of the first "
            "member in it; of a grid: members of a row",
        ),
    ]
    law: Annotated[
        FloatArray,
        Field(
            "n_block, 8",
            "the law's parameters (`mechanics.laws.law_table`); of springs from `spring.NEAR_AT` on their row of "
            "`Model.near`",
        ),
    ]
    active: Annotated[IndexArray, Field("n_seg, n_block", "1 where the law acts during a segment")]
    level: Annotated[FloatArray, Field("n_seg, n_block, 2", "a tabulated force at the segment's start (N), its slope")]
    power: Power
    member: Annotated[
        FloatArray,
        Field("n_end, padded", "P, Q in body frames (m); free length l0 (m); L² - l0² of the length L at home (m²)"),
    ]
    curves: Annotated[FloatArray, Field("n_curve", "what `curve` laws read")]
    times: Annotated[FloatArray, Field("n_seg + 1", "start, everything that has a kink in time, end (s)")]
    force: Force
    load_body: LoadBody
    load_follows: LoadFollows
    load_arm: LoadArm
    load_force: LoadForce
    timed_load: Annotated[
        IndexArray,
        Field("n_timed_load, 3", "of loads that are formulas of time: body, force or moment, and as `load_follows`"),
    ]
    timed_arm: Annotated[FloatArray, Field("n_timed_load, 6", "of these: the direction, the point of attack (m)")]
    timed_par: Annotated[
        FloatArray,
        Field("n_timed_load, 12", "their formulas: parameters, machine code, factor, summand (`kinematics.timed`)"),
    ]
    timed_mode: Annotated[IndexArray, Field("n_seg, n_timed_load", "bits of the formulas' switches in a segment")]
    driven_par: Annotated[FloatArray, Field("n_driven, 12", "as `timed_par`, of freedoms that formulas drive")]
    driven_mode: Annotated[IndexArray, Field("n_seg, n_driven", "bits of these formulas' switches in a segment")]
    bushing_pair: Annotated[IndexArray, Field("n_bushing", "the pair that a bushing connects")]
    bushing: Annotated[FloatArray, Field("n_bushing, n_elastic", "P, Q, its stretch at home, stiffness, damping")]
    driven: Annotated[IndexArray, Field("n_driven", "freedoms that are driven")]
    drive: Annotated[
        FloatArray,
        Field(
            "n_seg, n_driven, 4",
            "where they are in a segment: powers of the time since its start; of a rotation in space three angles, or "
            "integrals of the angular velocity's components since then",
        ),
    ]
    drive_frame: Annotated[
        FloatArray,
        Field(
            "n_turned, 11",
            "of each driven rotation in space what turns vectors of the body at home into the drive's axes, by rows; "
            "the first of its rows in `drive_turn`, and the one behind the last",
        ),
    ]
    drive_turn: Annotated[
        FloatArray,
        Field("n_turn, 5", "time (s), unit quaternion of the turn since the start by a prescribed angular velocity"),
    ]
    joint: Annotated[IndexArray, Field("n_joint, 5", "code, first and second body, pair, rows")]
    joint_par: Annotated[
        FloatArray, Field("n_joint, n_par", "the joint's parameters (`mechanics.joints.joint_table`, `spatial_joints`)")
    ]
    row: Annotated[IndexArray, Field("n_joint, rows", "the place of each of its rows among the solved ones, or -1")]
    unknown_index: Annotated[
        IndexArray,
        Field(
            "n_place",
            "where each free coordinate and each solved row stands in the banded matrix; behind it driven ones",
        ),
    ]
    size: Annotated[
        IndexArray,
        Field(
            "8",
            "solved rows; half width of the band; whether anything depends on velocity; entries of the joints' own "
            "matrix; slopes of the loads on a body; numbers of an attitude; threads that may share a pass over very "
            "many springs, where load cases do not take them; numbers of a relative pose",
        ),
    ]
    row_layout: Annotated[
        IndexArray,
        Field(
            "n_place - n, 4",
            "of each solved row: where its slopes begin among those of all joints (`joint_matrix`), the first "
            "freedom of each of its bodies, and where it stands in the joints' own matrix (`joint_matrix`)",
        ),
    ]
    skyline: Annotated[
        IndexArray,
        Field(
            "n_place - n, 2",
            "of each place there the first place that its row reaches, and where the row would begin among the entries "
            "of all rows if it reached the place 0",
        ),
    ]
    schur_product: Annotated[
        IndexArray,
        Field(
            "n_product, 4",
            "what that matrix is made of: an entry, two slopes by the same coordinate whose product, over its mass, "
            "belongs there, and for how many coordinates in a row this is so",
        ),
    ]
    schur_constant: Annotated[
        FloatArray, Field("size[3]", "what else it is made of: products of slopes that never change")
    ]
    response: Annotated[
        IndexArray, Field("n_response, 6", "kind, body, reference, component, order in time, group or joint")
    ]
    response_par: Annotated[
        FloatArray,
        Field("n_response, n_number", "a point or axis of the body, then numbers of its own, or what it counts from"),
    ]
    contact_pair: Annotated[IndexArray, Field("n_contact", "the pair of edge (or surface) and point")]
    contact: Annotated[FloatArray, Field("n_contact, n_surface", "see `mechanics.contact`, `spatial_contacts`")]
    varied: Annotated[
        IndexArray,
        Field(
            "n_varied, 6",
            "parameters that vary: block, place (`mechanics.laws.law_table`), which value, whether it is a time that "
            "stands exactly at the start (the end), and the members; ends that move (FIRST_END, SECOND_END); rising by "
            "value",
        ),
    ]
    along: Annotated[
        FloatArray,
        Field(
            "n_varied, n_along",
            "of an end that moves by its value: the direction, in the axes of its body that points have here, and by "
            "how much the free length grows (m per m)",
        ),
    ]
    apart: Annotated[
        FloatArray,
        Field("n_name", "of names that masses, loads or velocities follow from: how far those of `twins` are apart"),
    ]
    twins: Annotated[
        FloatArray,
        Field("n_name, 2, n_twin", "the packed scene, without members, with each of these larger and smaller"),
    ]
    twin_ints: Annotated[IndexArray, Field("n_twin_int", "the packed integers of these scenes")]


def without_numbers() -> dict[str, Any]:
    """Empty fields `apart`, `twins` and `twin_ints`, for a scene of which no numbers vary."""
    return {"apart": np.zeros(0), "twins": np.zeros((0, 2, 0)), "twin_ints": np.zeros(0, dtype=np.int64)}


class PlanarView:
    """A `GeneralModel` of bodies in a plane inside kernels, made by `unpack_general`."""

    def __init__(self, *_arrays: Any) -> None: ...


class SpatialView:
    """A `GeneralModel` of bodies in space inside kernels, made by `unpack_general`."""

    def __init__(self, *_arrays: Any) -> None: ...


FIELDS = Fields(GeneralModel)
bundle(PlanarView, FIELDS.names)
bundle(SpatialView, FIELDS.names)
move_by(PlanarView, PLANAR)
move_by(SpatialView, SPATIAL)


def pack_general(model: GeneralModel, kinematics: Kinematics = PLANAR) -> tuple[IndexArray, FloatArray]:
    """Flat integers (sizes first), as one row of a matrix where bodies are in space, and flat floats.

    The number of axes of the integers is what tells compiled functions how bodies move (`unpack_general`).
    """
    ints, floats = FIELDS.packed(model)
    return (ints if kinematics is PLANAR else ints.reshape(1, -1)), floats


@views_of(FIELDS, PlanarView, kernel)
def _planar(ints, floats):
    """The `GeneralModel` whose arrays are views of the packed ones."""


@views_of(FIELDS, SpatialView, kernel)
def _spatial(ints, floats):
    """The `GeneralModel` whose arrays are views of the packed ones."""


@kernel
def planar_twin(model, b, side):
    """The scene with number b of `GeneralModel.apart` larger (side 0) or smaller (side 1), in a plane."""
    return _planar(model.twin_ints, model.twins[b, side])


@kernel
def spatial_twin(model, b, side):
    """The scene with number b of `GeneralModel.apart` larger (side 0) or smaller (side 1), in space."""
    return _spatial(model.twin_ints, model.twins[b, side])


@kernel
def _spatial_row(ints, floats):
    """`_spatial` of integers that stand in one row."""
    return _spatial(ints.reshape(ints.size), floats)


def unpack_general(ints, floats):
    """The `GeneralModel` whose arrays are views of the packed ones (`pack_general`)."""
    raise NotImplementedError


by_type(unpack_general, "ints", lambda kind: (_planar, _spatial_row)[kind.ndim - 1])
