"""Compute one scene and say how it ended."""

import math
import time
import warnings

from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.stress.scene import Outcome, Refused, Scene


def judge(scene: Scene) -> Outcome:
    """The outcome of a scene, computed in this process."""
    began = time.perf_counter()
    found, message, note = None, "", ""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # what NumPy only warns of is a wrong number on its way
        try:
            measured = scene.measure(read_case(scene.text))
            found, note = measured if isinstance(measured, tuple) else (measured, "")
            right = found <= scene.bound and not scene.refusal  # a number where none can be right is wrong
            outcome = "right" if right else "wrong" if math.isfinite(found) else "not finite"
        except (Refused, CaseError) as refusal:
            outcome, message = "refused", str(refusal)
        except Exception as crash:
            outcome, message = "crashes", f"{type(crash).__name__}: {crash}"
    return Outcome(scene, outcome, found, message, time.perf_counter() - began, note)
