"""What stopped a motion that cannot be computed: members and bodies by name.

Nothing here is on the path of an evaluation that goes well.
"""

from collections.abc import Sequence

import numpy as np

from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.scene.compile_scene import Scene
from mdstopo.scene.grid_members import places_of
from mdstopo.scene.springs_model import COUNT, DESIGN, L0, PAIR, PRELOAD, PX, PY, QX, QY, STIFFNESS, FloatArray
from mdstopo.status import Status

#: a member this much shorter than at the start, when the step collapses, is what stopped the motion
COLLAPSED = 1e-4


class Diagnosis:
    """Words for what went wrong: which body or member of the scene an index means."""

    def __init__(self, case: Case, scene: Scene) -> None:
        self.case = case
        self.scene = scene

    def member(self, padded: int) -> str:
        """A member in words, from its place in the padded arrays."""
        for group, block in zip(self.case.members, self.scene.model.block.tolist(), strict=True):
            places = places_of(block)
            i = int(np.searchsorted(places, padded))
            if i < len(places) and places[i] == padded:
                return member_in_words(group, i)
        raise IndexError(f"no member at {padded}")

    def explain(
        self, design: FloatArray, status: Status, time: float, q: FloatArray, v: FloatArray
    ) -> tuple[Status, str]:
        """The status, and the member or body to blame in words, for a motion that ended at `time` in q, v (n,)."""
        where = f"at t = {time:.6g} s"
        meeting = self._collapsed(design, q)
        if meeting >= 0 and status in (Status.STEP_TOO_SMALL, Status.STEP_LIMIT, Status.NEWTON_FAILED):
            return Status.ZERO_LENGTH, f"{self.member(meeting)}, {where}"
        fastest = fastest_body(self.scene.bodies, v[: self.scene.n].reshape(-1, 3))
        return status, f"{where}; the fastest body is {fastest}"

    def _collapsed(self, design: FloatArray, q: FloatArray) -> int:
        """Padded index of the member that has shrunk to nothing while it carries a force, or -1."""
        model = self.scene.model
        best, found = COLLAPSED, -1
        for block, group in zip(model.block.tolist(), self.case.members, strict=True):
            places = places_of(block)
            strength = np.ones(block[COUNT])
            if block[DESIGN] >= 0:
                strength = design[block[DESIGN] : block[DESIGN] + block[COUNT]] ** group.power
            member = model.member[:, places]
            a, b = (3 * body for body in model.pair[block[PAIR]].tolist())
            ends = []
            for body, rows in ((a, (PX, PY)), (b, (QX, QY))):
                at = model.home[body // 3, :3] + q[body : body + 3]
                c, s = np.cos(at[2]), np.sin(at[2])
                x, y = member[rows[0]], member[rows[1]]
                ends.append(np.array([at[0] + c * x - s * y, at[1] + s * x + c * y]))
            ratio = np.hypot(*(ends[1] - ends[0])) / group.length
            carries = strength * (member[STIFFNESS] * member[L0] - member[PRELOAD]) != 0.0
            ratio = np.where(carries, ratio, np.inf)
            i = int(ratio.argmin())
            if ratio[i] < best:
                best, found = float(ratio[i]), int(places[i])
        return found


def member_in_words(group: MemberGroup, i: int) -> str:
    """Member i of a group, by its ends."""
    p, q = group.p_world[i], group.q_world[i]
    return (
        f"member {i} of group {group.name}, from ({_numbers(p)}) on {group.body_from} to "
        f"({_numbers(q)}) on {group.body_to}"
    )


def _numbers(point: FloatArray) -> str:
    return ", ".join(f"{value:g}" for value in point.tolist())


def fastest_body(bodies: Sequence[str], v: FloatArray) -> str:
    """The name of the body that moves fastest, or of one whose speed is no number.

    v (n_bodies, D): velocities, in the order of `bodies`, which may have ground behind them.
    """
    if not len(v):
        return GROUND
    speed = np.abs(v).max(axis=1)
    wild = np.flatnonzero(~np.isfinite(speed))
    return bodies[int(wild[0]) if wild.size else int(speed.argmax())]
