"""Whether fixed steps are far too large: what half the step gives instead.

Steps that the user fixes have no error control, and an implicit method stays stable at any step. So one that leaves
the motion unresolved gives numbers that look right. Halving it tells: of a resolved motion neither the largest
displacements nor the largest speeds change much; where a vibration is not resolved, its speeds are proportional to
1/step. Vibrations that the method damps out, as it should in stiff scenes, are too small to be seen in either.
"""

import numpy as np

from mdstopo.integrators.scene_driver import SceneDriver
from mdstopo.scene.springs_model import FloatArray
from mdstopo.status import Status

#: change, relative to what half the step gives, from which a step is far too large
COARSE = 0.3
#: displacements and speeds (m, rad, 1/s) that count as none
NO_MOTION = 1e-9

_KINDS = "displacement", "rotation", "speed", "angular velocity"


def coarse(driver: SceneDriver, alpha: FloatArray) -> str:
    """Why the driver's fixed step is far too long for the motion with alpha (N,), in words; empty where it is not.

    A motion that the step cannot compute at all is for the computation itself to report.
    """
    step = float(driver.settings[2])
    whole = _largest(driver, alpha)
    if whole is None:
        return ""
    driver.settings[2] = 0.5 * step
    try:
        half = _largest(driver, alpha)
    finally:
        driver.settings[2] = step
    if half is None:
        return f"with half of {step:g} s the motion cannot be computed"
    for kind, one, other in zip(_KINDS, whole, half, strict=True):
        if abs(one - other) > COARSE * other and max(one, other) > NO_MOTION:
            return f"half of {step:g} s changes the largest {kind} from {one:.3g} to {other:.3g}"
    return ""


def _largest(driver: SceneDriver, alpha: FloatArray) -> list[float] | None:
    """Largest displacement, rotation, speed and angular velocity of any body; None where the motion ends early."""
    status, steps = driver.simulate(alpha)
    if status is not Status.OK:
        return None
    moved = driver.displacements(steps.q)
    both = np.abs(np.stack([moved, steps.v.reshape(moved.shape)], axis=1))
    each = both.shape[-1]  # three in a plane, two of them places; six in space, three of them
    along, turned = np.split(both, [each - each // 2], axis=-1)
    return [float(along[:, 0].max()), float(turned[:, 0].max()), float(along[:, 1].max()), float(turned[:, 1].max())]
