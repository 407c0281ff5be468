"""Kernels whose text is written by the program, under the name and file of a function that stands for them."""

from collections.abc import Callable, Mapping
from types import FunctionType
from typing import Any, cast

from mdstopo.compiler.kernel import Kernel


def written(stub: FunctionType, source: str, names: Mapping[str, Any]) -> Callable[..., Any]:
    """The function that a text defines; compiled functions are kept by the stub's file and name, so it has those."""
    known = {"__name__": stub.__module__, **names}
    exec(compile(source, stub.__code__.co_filename, "exec"), known)
    function = known[stub.__name__]
    function.__qualname__, function.__doc__ = stub.__qualname__, stub.__doc__
    return cast(Callable[..., Any], function)


class WrittenKernel(Kernel):
    """A kernel with a text, which Python reads only when it is compiled or called.

    stub: has its name, arguments and documentation. names: what the text knows. like: a kernel with its settings.
    """

    def __init__(self, stub: FunctionType, source: str, names: Mapping[str, Any], like: Kernel) -> None:
        super().__init__(stub, like.fastmath, like.part)
        self._stub, self._source, self._names = stub, source, names
        del self.py_func  # the stub does nothing

    def __getattr__(self, name: str) -> Any:
        """What the text defines as `py_func`, read when it is first asked for."""
        if name != "py_func":
            raise AttributeError(f"{self._stub.__name__} has no {name}")
        self.py_func = written(self._stub, self._source, self._names)
        return self.py_func
