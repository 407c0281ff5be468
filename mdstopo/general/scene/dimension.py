"""What differs between scenes in a plane and in space when a case becomes arrays: one record of functions for each."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from mdstopo.case.model import Case, Joint, Load, LoadCase, Response
from mdstopo.general.scene.timed_loads import TimedPart
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.scene.loads import Loads
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: body name -> what turns points of its axes, as rows, into the axes that arrays have; a body that is missing has the
#: same ones
Frames = Mapping[str, FloatArray]
#: the two bodies of a pair -> the pair's number; whoever needs one adds it
Pairs = dict[tuple[int, int], int]


class JointRecord(Protocol):
    """What the compiler of a case needs to know of a joint's kernels.

    rows: how many it has. steady: for each the slopes, as freedoms of either body, that are the same wherever bodies
    are.
    """

    @property
    def rows(self) -> int: ...
    @property
    def steady(self) -> tuple[tuple[int, ...], ...]: ...


@dataclass(frozen=True, kw_only=True)
class Dimension:
    """What differs between a plane and space where a case becomes arrays.

    kinematics: how its bodies move. point: numbers of a point. axes: the words of a body's motions, in the order of its
    freedoms. components: what a component of a response is called -> its code. response_par: numbers of a response.

    home (load_case, count): (count, n_home), where bodies start, ground behind them. frames (load_case): see `Frames`.
    masses (body): mass of each freedom. velocities (body, row of home): those of its freedoms at the start.
    stated (home): (n,) where each freedom is at home, from which stated positions are measured; 0 of turns.
    places (home, body, points): global places (K, d) at home of points (K, d) of a body, in the axes of arrays.
    loads (load_case, index, times, frames, keep): as arrays (`scene.loads`). timed (load, frames): its parts that are
    formulas.
    bushings (case, index, pairs, home): as arrays.
    half_turn (pairs, home, q): the first of the states q (T, n_q) at which one of the pairs (K, 2) of bodies has turned
    by half a turn, where that may not be, and which; None where none has. contacts (case, index, pairs, frames): as
    arrays, and in words. reaches (contact): (n_contact,) how far the point of each contact is from
    its body's centre.
    joint_code, joint_kernels (class): of a joint. has_norm (class): whether its force has several components, and is
    not a number along a line. joint_row (joint, home, first, second, frames): its parameters.
    response_row (response, frames): its numbers.
    """

    kinematics: Kinematics
    point: int
    axes: tuple[str, ...]
    components: Mapping[str, int]
    response_par: int
    home: Callable[[LoadCase, int], FloatArray]
    frames: Callable[[LoadCase], Frames]
    masses: Callable[[Any], list[float]]
    velocities: Callable[[Any, FloatArray], list[float]]
    stated: Callable[[FloatArray], FloatArray]
    places: Callable[[FloatArray, int, FloatArray], FloatArray]
    loads: Callable[..., Loads]
    timed: Callable[[Load, Frames], Iterable[TimedPart]]
    bushings: Callable[[Case, dict[str, int], Pairs, FloatArray], tuple[IndexArray, FloatArray]]
    half_turn: Callable[[IndexArray, FloatArray, FloatArray], tuple[int, int] | None]
    contacts: Callable[[Case, dict[str, int], Pairs, Frames], tuple[IndexArray, FloatArray, tuple[str, ...]]]
    reaches: Callable[[FloatArray], FloatArray]
    joint_code: Callable[[type[Joint]], int]
    joint_kernels: Callable[[type[Joint]], JointRecord]
    has_norm: Callable[[type[Joint]], bool]
    joint_row: Callable[[Joint, FloatArray, int, int, Frames], list[float]]
    response_row: Callable[[Response, Frames], list[float]]


def in_frame(frames: Frames, body: str, points: FloatArray) -> FloatArray:
    """Points (..., d) of a body in the axes that the kernels use for it."""
    if body not in frames:
        return points
    turned: FloatArray = points @ frames[body]
    return turned


def dimension_of(case: Case) -> Dimension:
    """What differs between a plane and space, for the dimension of a case."""
    if case.dimension > 2:
        from mdstopo.general.scene.spatial_scene import SPACE

        return SPACE
    from mdstopo.general.scene.planar_scene import PLANE

    return PLANE
