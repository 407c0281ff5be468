"""Functions whose kernel is chosen by the types of the arguments (`jit.by_type`). Imports Numba."""

from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global


def offer(stub: Callable[..., Any], choose: Callable[..., Any]) -> None:
    """Have Numba call, for `stub`, the kernel that `choose` returns for the types; none is an error of types.

    Numba's own `overload` would compile the kernel once more, and all of it to machine code.
    """
    compiled: dict[Any, Any] = {}

    class Chosen(AbstractTemplate):
        key = stub

        def generic(self, asked: Any, named: Any) -> Any:
            kernel = choose(*asked, **named)
            if kernel is None:
                return None
            kind = types.Dispatcher(kernel.dispatcher)
            found = kind.get_call_type(self.context, asked, named)
            if found is not None:
                compiled[found.args] = kind.get_impl_key(found)
            return found

        def get_impl_key(self, found: Any) -> Any:
            return compiled[found.args]

    infer_global(stub)(Chosen)
