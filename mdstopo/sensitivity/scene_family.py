"""What the engine asks of a family of kernels: scenes, their drivers, and candidates that are priced.

There are two: springs between free bodies (`sensitivity.springs_driver`), and everything else
(`general.driver.general_driver`). `scene.family` tells which one a case needs; nothing else asks for it.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from mdstopo.case.model import Case, MemberGroup
from mdstopo.integrators.scene_driver import DriverOptions, Scene, SceneDriver
from mdstopo.scene.springs_model import FloatArray

if TYPE_CHECKING:
    from mdstopo.sensitivity.candidate_pass import CandidatePass


class SceneFamily(NamedTuple):
    """What one family of kernels computes.

    scenes: the load cases of a case as scenes, by name. driver: the driver of one of them. candidates: those of a
    priced group, from the scenes, the group's number and those of its mirror images, the group as the scenes have it,
    where its points P and Q are at the start, (n, d) each, and about how many are meant (None: all).
    """

    scenes: Callable[[Case], Mapping[str, Scene]]
    driver: Callable[[Case, Any, DriverOptions], SceneDriver]
    candidates: Callable[
        [Mapping[str, Any], Sequence[int], MemberGroup, tuple[FloatArray, FloatArray], int | None], "CandidatePass[Any]"
    ]
