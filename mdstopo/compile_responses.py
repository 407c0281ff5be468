"""What `warm.BackgroundCompiler` runs in another process: `python -m mdstopo.compile_responses INTEGRATOR [MODULE...]`.

It compiles the kernels that evaluate responses on the steps of an integrator; before that, it calls the
`compile_in_background` of each module.
"""

import gc
import importlib
import sys

from mdstopo.children import end_with_parent
from mdstopo.engine import Evaluator
from mdstopo.integrators.driver import Driver
from mdstopo.warm import tiny


def compile_responses(integrator: str) -> None:
    """Compile the kernels that evaluate responses from an integrator's steps; another process compiles the integrator
    itself."""
    driver = Evaluator(tiny(integrator), in_background=False).driver("default")
    assert isinstance(driver, Driver)
    driver.compile_responses()


if __name__ == "__main__":
    end_with_parent(sys.stdin.buffer)
    gc.disable()  # as in `session.compiling_apart`
    for module in sys.argv[2:]:
        importlib.import_module(module).compile_in_background()
    compile_responses(sys.argv[1])
    gc.freeze()  # it would be looked through at the end as well
