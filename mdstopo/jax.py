"""A case as a JAX function with its exact gradient: `pip install 'mdstopo[jax]'`.

    values = mdstopo.jax.function(case)
    jax.grad(lambda x: values(x)[0])(case.start)

What `values` gives are objectives, then excesses of constraints, as `mdstopo.functions.Responses` has them. It may be
used in `jit`, `grad`, `vmap` (one after the other) and as a part of other functions; the design is computed by mdstopo
on the processor, in double precision, and rounded to what JAX uses (`jax_enable_x64`). Derivatives of the gradient, and
forward mode, do not exist.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.functions import Responses, extra

with extra("jax", "JAX"):
    import jax


def function(case: Case, method: str = "auto") -> Callable[[Any], Any]:
    """x (n,) -> (m,): values of a case's objectives and constraints; method: of differentiation."""
    responses = Responses(case, method)
    rows, columns = len(responses.names), len(responses.x0)
    dtype = jax.dtypes.canonicalize_dtype(np.float64)
    value = jax.ShapeDtypeStruct((rows,), dtype)  # type: ignore[no-untyped-call, unused-ignore]
    slope = jax.ShapeDtypeStruct((rows, columns), dtype)  # type: ignore[no-untyped-call, unused-ignore]

    def compute(x: Any) -> tuple[Any, Any]:
        found, slopes = responses.at(np.asarray(x))
        return found.astype(dtype), slopes.astype(dtype)

    def both(x: Any) -> Any:
        return jax.pure_callback(compute, (value, slope), x, vmap_method="sequential")

    @jax.custom_vjp
    def values(x: Any) -> Any:
        return both(x)[0]

    def pull_back(slopes: Any, cotangent: Any) -> tuple[Any]:
        return (cotangent @ slopes,)

    values.defvjp(both, pull_back)
    chosen: Callable[[Any], Any] = values
    return chosen
