"""Whether joints fit where a motion starts, or the nearest start at which they do."""

import numpy as np

from mdstopo.case.model import Joint
from mdstopo.case.text.errors import CaseError
from mdstopo.general.driver_interface import DriverWithStart
from mdstopo.general.scene.extent import size_of, speed_of
from mdstopo.mechanics.joints.joint_table import describe
from mdstopo.scene.springs_model import FloatArray

#: misfit of a joint at the start, relative to the scene's size or speeds, up to which it fits
FITS = 1e-8


def fitted_start(driver: DriverWithStart) -> tuple[FloatArray, FloatArray]:
    """The start, q (n_q,) and v (n,): as stated, or moved to the nearest that fits where the case asks for it. Joints
    that do not fit there are refused (CaseError)."""
    case = driver.case
    q, v, mistakes = _fitted(driver, case.solver.assemble)
    if mistakes:
        hint = _remedy(driver, [joint for joint, _ in mistakes])
        raise CaseError(
            [case.marks.mistake(f"joints[{joint.index}]", text + hint) for joint, text in mistakes],
            str(case.path or case.name),
        )
    return q, v


def _fitted(driver: DriverWithStart, move: bool) -> tuple[FloatArray, FloatArray, list[tuple[Joint, str]]]:
    """The start (q, v), moved to the nearest that fits if asked for, and which joints do not fit there, and how."""
    from mdstopo.general.statics.start_entry import assemble

    model = driver.scene.model
    q, v = model.q0.copy(), model.v0.copy()
    phi, rates = np.zeros((2, *model.row.shape))
    assemble(driver.ints, driver.floats, q, v, move, phi, rates)
    size = size_of(driver.case)
    span = driver.scene.load_case.end - driver.scene.load_case.start
    speed = max(speed_of(driver.case, v, driver.scene.kinematics), size / span)
    mistakes = []
    for j, joint in enumerate(driver.case.joints):
        misfit, rate = float(np.abs(phi[j]).max()), float(np.abs(rates[j]).max())
        if misfit > FITS * size:
            problem = "cannot be assembled" if move else "does not fit at the start"
            mistakes.append((joint, f"{describe(joint)} {problem}: its misfit is {misfit:.3g} (m or rad)"))
        elif rate > FITS * speed:
            mistakes.append((joint, f"the start velocities tear {describe(joint)} apart at {rate:.3g} (m/s or rad/s)"))
    return q, v, mistakes


def _remedy(driver: DriverWithStart, joints: list[Joint]) -> str:
    """What helps where these joints do not fit at the start, or what is in the way."""
    if not driver.case.solver.assemble and not _fitted(driver, True)[2]:
        return "; `solver: {assemble: true}` moves the start to the nearest that fits"
    held = {name for joint in joints for name in joint.bodies}
    driven = [motion.body for motion in driver.scene.load_case.motions if motion.body in held]
    moves = "moves" if len(driven) == 1 else "move"
    return f"; no start fits it while {' and '.join(driven)} {moves} as prescribed" if driven else ""
