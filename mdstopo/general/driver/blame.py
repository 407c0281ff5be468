"""Why a run of a general scene ended early, and which joint, body, bushing, contact or member is to blame, in words."""

from typing import TYPE_CHECKING

import numpy as np

from mdstopo.general.model.general_model import COUNT, GROUP, OFFSET, START
from mdstopo.integrators.steps import CHATTERING, HALF_TURN, OK, SINGULAR, STEP_LIMIT
from mdstopo.mechanics.joints.joint_table import describe
from mdstopo.scene.diagnosis import fastest_body, member_in_words

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver


def why_it_ended(driver: "GeneralDriver", code: int, time: float) -> str:
    """Why the last run of a driver ended early, at a time (s), and who is to blame; empty where it did not."""
    if code == OK:
        return ""
    when = f"at t = {time:.6g} s"
    if code == SINGULAR:
        steps = f", in steps of {driver.settings[2]:.3g} s" if driver.settings[2] > 0.0 else ""
        return f"{_singular(driver, int(driver.where[0]))}, {when}{steps}"
    if code == HALF_TURN:
        bushing = driver.case.bushings[int(driver.where[0])]
        return f"bushings[{bushing.index}] (between {bushing.bodies[0]} and {bushing.bodies[1]}), {when}"
    if code == CHATTERING:
        return f"{named_member(driver, int(driver.where[0]))}, {when}"
    if code == STEP_LIMIT and driver.where[0] >= 0:
        who = named_member(driver, int(driver.where[0]))
        return f"{when}; {who} brakes too fast for explicit steps: a larger slip or a smaller damping needs fewer"
    t, _, v = driver.states()
    v = v[int(np.argmin(np.abs(t - time))), : driver.scene.n].reshape(driver.scene.n_bodies, -1)
    return f"{when}; the fastest body is {fastest_body(driver.scene.bodies, v)}"


def _singular(driver: "GeneralDriver", place: int) -> str:
    """The joint whose row stands at a place of the matrix, or the body whose coordinate does."""
    model = driver.scene.model
    n = len(model.mass)
    if place >= len(model.unknown_index):
        return describe(driver.case.joints[place - len(model.unknown_index)])
    unknown = int(np.flatnonzero(model.unknown_index == place)[0])
    if unknown >= n:
        return describe(driver.case.joints[int(np.argwhere(model.row == unknown - n)[0, 0])])
    body = unknown // driver.scene.kinematics.freedoms
    tied = [joint for joint in driver.case.joints if driver.scene.bodies[body] in joint.bodies]
    return describe(tied[0]) if tied else f"body {driver.scene.bodies[body]}"


def named_member(driver: "GeneralDriver", padded: int) -> str:
    """A member (or contact) in words, from its place in the padded arrays."""
    if padded >= driver.scene.model.member.shape[1]:
        return driver.scene.contacts[int(padded - driver.scene.model.member.shape[1])]
    for block in driver.scene.model.block.tolist():
        i = padded - block[START]
        if 0 <= i < block[COUNT]:
            group = driver.case.members[block[GROUP]]
            return member_in_words(group, i + block[OFFSET])
    return "a member"
