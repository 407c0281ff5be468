"""The explicit Runge-Kutta methods of general scenes: their stages, what estimates a step's error, and the run.

The methods are those of `integrators.springs_runge_kutta`: each stage's accelerations come from the balance with its
joints.
"""

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.integrators.adaptive_steps import run_adaptive
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.steps.method_interface import implement
from mdstopo.general.steps.step_history import carve_history
from mdstopo.general.steps.step_inside import make_stages
from mdstopo.integrators import springs_runge_kutta
from mdstopo.integrators.runge_kutta_tables import ORDERS, STAGES

TAG = (0,)
#: error of a step of the length tau, relative to the motion (`first_step`), of both methods; measured on rings,
#: linkages and contacts, from 2e-7 to 2e-5 for the second
FIRST_ERRORS = 1e-8, 4e-6


@entry
def simulate(ints, floats, tables, alpha, tangent, settings, limits, room, room_ints, member_state, work, where):
    """Integrate the motion of a design over model.times (`adaptive_steps.run_adaptive`).

    Constant:
      ints, floats: the packed scene (`pack_general`).
      tables (2, 3, 17, 17): coefficients of both methods (`integrators.runge_kutta_tables`).
      settings (5,), limits (6,): see `run_adaptive`.
    In:
      alpha (N,), tangent: the design; whether tangents are kept for a reverse sweep.
    Out:
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      member_state, work, where, and what is returned: see `run_adaptive`.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    return run_adaptive(TAG, model, tables, alpha, tangent, settings, limits, history, member_state, work, where)


@kernel
def step_error(tag, vectors, s, h, longest, a, weight):
    """The estimated error of a step, the same as for springs alone; see `method_interface.step_error`."""
    return springs_runge_kutta.step_error(vectors, s, h, longest, a, weight)


@kernel
def scheme(tag, method):
    """One of two schemes of the method; see `method_interface.scheme`."""
    return STAGES[method], ORDERS[method], FIRST_ERRORS[method]


@kernel
def is_explicit(tag):
    """Whether stages follow from those before them: those of Runge-Kutta do."""
    return True


implement(TAG, make_stages=make_stages, step_error=step_error, scheme=scheme, is_explicit=is_explicit)
