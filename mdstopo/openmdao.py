"""A case as an OpenMDAO component with exact partial derivatives: `pip install 'mdstopo[openmdao]'`.

    problem = openmdao.api.Problem()
    problem.model.add_subsystem("system", mdstopo.openmdao.CaseComponent(case=case), promotes=["*"])

Inputs are `alpha` and each of the case's variables by its name, in the parameters' own units; outputs are the
objectives by their names, and `constraints`, the excesses over their bounds. A design that cannot be computed raises
OpenMDAO's AnalysisError, which its optimisers know how to take.
"""

from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.functions import NoValueError, Responses, extra

with extra("openmdao", "OpenMDAO"):
    import openmdao.api as om


class CaseComponent(om.ExplicitComponent):  # type: ignore[misc, unused-ignore]
    """An OpenMDAO component that computes the objectives and constraints of a case from its design."""

    def initialize(self) -> None:
        """Say which options there are."""
        self.options.declare("case", types=Case, desc="the design problem")
        self.options.declare("method", default="auto", desc="of differentiation")

    def setup(self) -> None:
        """Say which inputs and outputs there are."""
        case = self.options["case"]
        self._case_responses = Responses(case, self.options["method"])
        self._case_parts = {"alpha": slice(0, case.n_design), **case.space.parts}
        for name, part in self._case_parts.items():
            self.add_input(name, val=self._case_responses.x0[part])
        for name in self._case_responses.objectives:
            self.add_output(name)
        if case.constraints:
            self.add_output("constraints", shape=len(case.constraints))
        self.declare_partials("*", "*")

    def compute(self, inputs: Any, outputs: Any) -> None:
        """Compute objectives and constraints."""
        values, _ = self._at(inputs)
        for place, name in enumerate(self._case_responses.objectives):
            outputs[name] = values[place]
        if self.options["case"].constraints:
            outputs["constraints"] = values[len(self._case_responses.objectives) :]

    def compute_partials(self, inputs: Any, partials: Any) -> None:
        """Compute the derivatives of objectives and constraints."""
        _, slopes = self._at(inputs)
        count = len(self._case_responses.objectives)
        for own, part in self._case_parts.items():
            for place, name in enumerate(self._case_responses.objectives):
                partials[name, own] = slopes[place, part]
            if self.options["case"].constraints:
                partials["constraints", own] = slopes[count:, part]

    def _at(self, inputs: Any) -> tuple[Any, Any]:
        try:
            return self._case_responses.at(np.concatenate([np.ravel(inputs[name]) for name in self._case_parts]))
        except NoValueError as error:
            raise om.AnalysisError(str(error)) from error
