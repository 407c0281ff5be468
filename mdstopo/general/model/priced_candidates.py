"""The members of a group that are not built, and the states from which their prices follow, as arrays for kernels.

Made by `general.driver.general_pricing`; what is priced with them stands in `general.pricing.candidate_prices`.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np

from mdstopo.compiler.fields import Field, Fields, views_of
from mdstopo.compiler.jit import kernel
from mdstopo.general.model.bundles import bundle
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: columns of `PricedCandidates.run`
SCENE, CODE, FIRST_STATE, FIRST_ENERGY, LAST_STATE, FIRST_STEP, LAST_STEP, MODES = range(8)
#: the modes of a law: none, or of no account; those in which its members are followed through the steps
NONE, FOLLOWED = range(2)
#: columns of `PricedCandidates.step`, and what a step may be
FIRST_STAGE, LAST_STAGE, FIRST_NODE, KIND, MOVES = range(5)
WHOLE, PART, POINT = range(3)
#: how many levels there are, of which level n has states for 2^n steps behind each other; columns of
#: `PricedCandidates.few`
TOGETHER_LEVELS = 5
FIRST_FEW, BEHIND_FEW = range(2)
#: fractions of a step at which a member that switches is sampled (Gauss and Lobatto), and what makes of values there
#: the coefficients of the polynomial through all, by powers of twice the fraction less one
NODES = 6
_ROOTS = np.sort(np.polynomial.legendre.Legendre.basis(NODES - 1).deriv().roots())
NODE = 0.5 + 0.5 * np.concatenate([[-1.0], _ROOTS, [1.0]])
POWERS = np.ascontiguousarray(np.linalg.inv(np.vander(2.0 * NODE - 1.0, increasing=True)))
#: arrays of states in `PricedCandidates`, and of steps and nodes
ARRAYS = (
    "pose", "change", "pose_a", "energy", "when", "level", "frame", "step", "step_time", "node_pose", "node_a",
    "node_change", "node_level", "node_energy", "node_frame", "few", "nearest",
)  # fmt: skip


class PricedCandidates(NamedTuple):
    """The candidates of a group, and the states from which their prices follow: by scenes, and by runs of states.

    Where a candidate has mirror images, a scene has one entry for each of them, with points of its own.
    """

    run: Annotated[
        IndexArray,
        Field(
            "n_run, 8",
            "of the states in which one law of one scene is evaluated: the scene; the law's code; the first state, the "
            "first one whose energy counts, and the one behind all; of a law that switches the first step, and the one "
            "behind all; which modes it has (NONE and so on)",
        ),
    ]
    rest: Annotated[FloatArray, Field("n_run", "the law's free length (m); negative: the length as stated")]
    law: Annotated[FloatArray, Field("n_run, 8", "its parameters (`mechanics.laws.law_table`)")]
    curves: Annotated[FloatArray, Field("n_scene, n_curve", "numbers of the scene's laws")]
    pose: Annotated[FloatArray, Field("n_state, 1, n_pose", "relative pose of the group's bodies, and its rates")]
    change: Annotated[FloatArray, Field("n_state, 1, n_free", "minus the virtual change of the pose")]
    pose_a: Annotated[FloatArray, Field("n_state, n_free", "second derivative of the pose in time")]
    energy: Annotated[FloatArray, Field("n_state", "weight of the stored energy")]
    when: Annotated[FloatArray, Field("n_state", "time (s)")]
    level: Annotated[FloatArray, Field("n_state", "the law's tabulated force (N)")]
    frame: Annotated[
        FloatArray,
        Field("n_state, n_frame", "of laws with modes, how ends move there (`Kinematics.frames`), else zeros"),
    ]
    step: Annotated[
        IndexArray,
        Field(
            "n_step, 5",
            "of laws that switch, in the order of time: the first stage among the states, and the one behind the last; "
            "the first node; whether it is a whole step, a part of one, or a state alone; whether anything is virtual",
        ),
    ]
    step_time: Annotated[
        FloatArray,
        Field(
            "n_step, 2",
            "when it begins, and how long it is (s); of a state alone, by how much later it is decided in which mode a "
            "member is there: less than zero at the end of a step, where a built member may switch",
        ),
    ]
    node_pose: Annotated[FloatArray, Field("n_node, n_pose", "relative poses at NODE of each step, and their rates")]
    node_a: Annotated[FloatArray, Field("n_node, n_free", "their second derivatives")]
    node_change: Annotated[
        FloatArray, Field("n_node, n_free", "minus their virtual changes, by the fraction of the step")
    ]
    node_level: Annotated[
        FloatArray, Field("n_node", "coefficients of the law's tabulated force (N) in a step, as of POWERS")
    ]
    node_energy: Annotated[
        FloatArray, Field("n_node", "those of the weight of the stored energy, by the fraction of the step")
    ]
    node_frame: Annotated[FloatArray, Field("n_node, n_frame", "how ends move there (`Kinematics.frames`)")]
    few: Annotated[
        IndexArray,
        Field(
            f"n_step, {TOGETHER_LEVELS}, 2",
            "of each step, and of the 2, 4 and so on behind each other of which it is the first: the first of the "
            "states over which smooth forces are summed, and the one behind the last: the stages of a single step, "
            "fewer than these of several (`driver.fewer_states`); both 0 where these have none together",
        ),
    ]
    nearest: Annotated[
        FloatArray,
        Field(
            f"n_step, {TOGETHER_LEVELS}",
            "for which candidates these states will do: those whose inverse length (1/m) is no larger at the first one",
        ),
    ]
    first: Annotated[FloatArray, Field("n_scene, n_axis, n_first", "points of the one grid in their body's frame (m)")]
    second: Annotated[FloatArray, Field("n_scene, n_axis, n_second", "points of the other grid, likewise")]
    first_home: Annotated[FloatArray, Field("n_scene, n_axis, n_first", "the points of the one grid at the start (m)")]
    second_home: Annotated[FloatArray, Field("n_scene, n_axis, n_second", "those of the other grid")]
    first_stated: Annotated[
        FloatArray, Field("n_scene, n_axis, n_first", "where the scene's case has the points of the one grid (m)")
    ]
    second_stated: Annotated[FloatArray, Field("n_scene, n_axis, n_second", "where it has those of the other grid")]
    first_place: Annotated[
        FloatArray, Field("n_axis, n_first", "where they are for what members cost, and which there are (m)")
    ]
    second_place: Annotated[FloatArray, Field("n_axis, n_second", "likewise of the other grid")]


class PricedCandidatesView:
    """A `PricedCandidates` inside kernels, made by `unpack_candidates`."""

    def __init__(self, *_arrays: Any) -> None: ...


FIELDS = Fields(PricedCandidates)
bundle(PricedCandidatesView, FIELDS.names)


@views_of(FIELDS, PricedCandidatesView, kernel)
def unpack_candidates(ints, floats):
    """The `PricedCandidates` whose arrays are views of the packed ones."""
