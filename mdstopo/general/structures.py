"""The types of all structures (`general.model.bundles`), found by name.

Numba's disk cache asks this module for them, also in a process that compiles kernels for scenes without any: a kernel's
cache lists all the types that it was ever compiled for.
"""

from mdstopo.compiler.kernel import numba
from mdstopo.general.model.bundles import ENDING, KINDS


def __getattr__(name: str) -> type:
    """A type of a structure; all of them are made when the first one is asked for that is not made yet."""
    if name.endswith(ENDING) and name not in KINDS:
        from mdstopo.general.dynamics import accelerations  # noqa: F401 (this and the following have structures)
        from mdstopo.general.events import event_log, landing  # noqa: F401
        from mdstopo.general.integrators import (  # noqa: F401
            adaptive_run,
            gauss_window,
            generalized_alpha_run,
            generalized_alpha_step,
        )
        from mdstopo.general.model import general_model, priced_candidates  # noqa: F401
        from mdstopo.general.peaks import dense_output  # noqa: F401
        from mdstopo.general.pricing import (  # noqa: F401
            priced_tile,
            sorted_members,
            switching_prices,
            switching_together,
        )
        from mdstopo.general.steps import step_history, step_trial  # noqa: F401

        numba()
    try:
        return KINDS[name]
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None


def __dir__() -> list[str]:
    """The module's own names and the types that are made by now."""
    return sorted({*globals(), *KINDS})
