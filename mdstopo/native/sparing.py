"""What Numba is spared in a process of our own, where nobody else uses it. Imports Numba.

It asks again and again what the sum of two floats is, trying dozens of candidates each time; and it makes machine code
of every little function of its own that a kernel calls, though a kernel holds a copy of what it calls.
"""

from typing import Any

from numba import types
from numba.core.target_extension import get_local_target, jit_registry

from mdstopo.native.library import LEFT


def spare() -> None:
    """Change Numba for the rest of this process."""
    _remember_signatures()
    _leave_overloads()


def _remember_signatures() -> None:
    """What operators give for numbers, arrays and tuples of them is looked for once."""
    function: Any = types.Function
    ask = function.get_call_type
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, asked: Any, named: Any) -> Any:
        lasting = getattr(self.typing_key, "__module__", None) == "_operator"
        if not lasting or named or not all(isinstance(each, _LASTING) for each in asked):
            return ask(self, context, asked, named)
        key = self, context, asked if isinstance(asked, tuple) else tuple(asked)
        found = known.get(key)
        if found is None:
            found = known[key] = ask(self, context, asked, named)
        return found

    function.get_call_type = get_call_type


_LASTING = (types.Number, types.Boolean, types.Literal, types.Array, types.BaseTuple)


def _leave_overloads() -> None:
    """Functions of Numba's own get no machine code where kernels call them."""
    from numba.core.registry import cpu_target

    target = get_local_target(cpu_target.typing_context)
    jit = jit_registry[target]

    def left(*given: Any, **options: Any) -> Any:
        return jit(*given, **{"no_cfunc_wrapper": True, "pipeline_class": LEFT, **options})

    dict.__setitem__(jit_registry, target, left)
