"""Springs between free bodies, for the engine: their scenes, and a driver that simulates and differentiates them."""

from collections.abc import Mapping, Sequence
from pkgutil import resolve_name
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.model import Case, MemberGroup
from mdstopo.integrators.driver import Driver
from mdstopo.integrators.scene_driver import DriverOptions
from mdstopo.scene.compile_scene import Scene, compile_members, compile_scene, state_order
from mdstopo.scene.diagnosis import Diagnosis
from mdstopo.scene.settled import Settled
from mdstopo.scene.springs_model import FloatArray
from mdstopo.scene.vibration_modes import Modes
from mdstopo.sensitivity.scene_family import SceneFamily
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.sensitivity.springs_pricing import SpringCandidates, SpringPricingStates


class SpringsDriver(Driver):
    """One scene of springs between free bodies, ready to run; `integrators.scene_driver.SceneDriver` tells how."""

    def __init__(self, case: Case, scene: Scene, options: DriverOptions) -> None:
        kinds = [REDUCTIONS[each.over_time] for each in options.responses]
        reductions = np.array([resolve_name(kind.springs) for kind in kinds], dtype=np.int64)
        integrated = any(kind.is_integral for kind in kinds)
        super().__init__(scene, options, _response_entries, reductions, integrated)
        self.case = case
        self._diagnosis = Diagnosis(case, scene)

    def response_history(self, alpha: FloatArray, times: FloatArray) -> FloatArray:
        """(n_resp, T): the stored energy of a design at times (T,), for each objective that is of it."""
        from mdstopo.responses.stored_energy import stored_energy

        energy = stored_energy(self.case, alpha, self.simulate(alpha)[1].at(times)[0] + self._home)
        return np.tile(energy, (len(self.reductions), 1))

    @property
    def _home(self) -> FloatArray:
        home: FloatArray = self.scene.model.home[:, :3].ravel()
        return home

    def member(self, padded: int) -> str:
        """A member in words, from its place in the padded arrays."""
        return self._diagnosis.member(padded)

    def displacements(self, q: FloatArray) -> FloatArray:
        """(T, n_body, 3): by how much bodies have moved and turned (m, rad) at q (T, n) since its first row."""
        moved: FloatArray = (q - q[0]).reshape(len(q), -1, 3)
        return moved

    def explain(
        self, alpha: FloatArray, status: Status, time: float, q: FloatArray, v: FloatArray
    ) -> tuple[Status, str]:
        """The status of a run that ended at `time` in a state (2, n), and who is to blame, in words."""
        return self._diagnosis.explain(alpha, status, time, q, v)

    def pricing_states(self, factor: FloatArray) -> "SpringPricingStates":
        """The states from which prices follow, of the rows of the last evaluation times factor (n_obj, R)."""
        from mdstopo.sensitivity.springs_pricing import pricing_states_of

        return pricing_states_of(self, factor)

    def start_modes(self, alpha: FloatArray) -> Modes:
        """Small motion about the start."""
        from mdstopo.mechanics.start_frequencies import start_modes

        return start_modes(self.case, self.scene, alpha)

    def settled(self, alpha: FloatArray) -> Settled | None:
        """None: a case that settles is none of springs between free bodies."""
        return None


def _response_entries() -> ModuleType:
    """The compiled entries that evaluate responses from the steps."""
    from mdstopo.sensitivity import energy_responses

    return energy_responses


def _scenes(case: Case) -> Mapping[str, Scene]:
    order = state_order(case)
    shared = compile_members(case, {name: i for i, name in enumerate(order)})
    return {load_case.name: compile_scene(case, load_case, shared) for load_case in case.load_cases}


def _candidates(
    scenes: Mapping[str, Scene],
    places: Sequence[int],
    group: MemberGroup,
    homes: tuple[FloatArray, FloatArray],
    count: int | None,
) -> "SpringCandidates":
    """The candidates of a priced group without mirror images; all load cases have the same."""
    from mdstopo.sensitivity.springs_pricing import SpringCandidates

    (place,) = places
    return SpringCandidates(group, next(iter(scenes.values())).model.block[place], homes, count)


SPRINGS = SceneFamily(_scenes, SpringsDriver, _candidates)
