"""Kernels that are chosen by a code: a chain of branches made from a list, so that nobody writes it.

    LISTED: Listed[Kernels] = Listed()
    ...
    LISTED.is_filled = True

    @chosen(LISTED, lambda each: each.force, inline)
    def law(code, p, x):
        "The force."
        return 0.0

With a, b in the list `law` is compiled as if it read

    if code == 0: return a.force(p, x)
    if code == 1: return b.force(x)
    return 0.0

A kernel takes those of the arguments that its own arguments name. Where the list has none for a code, what was
decorated is called. The list may become longer at any time, by what other distributions bring: whatever was
compiled before is then made anew, and kept in a folder of its own (`store.include`).
"""

import inspect
from collections.abc import Callable, Iterator
from types import FunctionType
from typing import Any, Generic, TypeVar, cast

from mdstopo.compiler.kernel import Kernel, compile_anew
from mdstopo.compiler.written import written

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")


class Listed(Generic[T]):
    """Things by their codes, from 0.

    While a module is imported it fills its list, and nothing can have been compiled with it. `is_filled` says that it
    has, and that from then on one more thing makes what was compiled anew.
    """

    def __init__(self) -> None:
        self._things: list[T] = []
        self.is_filled = False

    def __len__(self) -> int:
        return len(self._things)

    def __iter__(self) -> Iterator[T]:
        return iter(self._things)

    def __getitem__(self, code: int) -> T:
        return self._things[code]

    def add(self, thing: T) -> int:
        """Append one; returns its code."""
        self._things.append(thing)
        if self.is_filled:
            compile_anew()
        return len(self._things) - 1


class Choice(Kernel):
    """A kernel whose first argument says which kernel of a list is called with the others.

    pick: of a thing in the list its kernel, or a number or truth that is returned as it is, or None.
    """

    def __init__(self, stub: FunctionType, listed: Listed[Any], pick: Callable[[Any], Any], how: Any) -> None:
        self._otherwise: Kernel = how(stub)
        super().__init__(stub, self._otherwise.fastmath, self._otherwise.part)
        self._stub, self._listed, self._pick = stub, listed, pick
        self._made_of = -1

    @property
    def dispatcher(self) -> Any:
        """Numba's object for the branches of today's list."""
        if self._made_of != len(self._listed):
            self._made_of = len(self._listed)
            self.py_func = self._branches()
            self.forget()
        return super().dispatcher

    def _branches(self) -> Callable[..., Any]:
        """The function with a branch for each thing in the list that has a kernel."""
        asked = list(inspect.signature(self._stub).parameters)
        named: dict[str, Any] = {"otherwise": self._otherwise}
        lines = [f"def {self._stub.__name__}({', '.join(asked)}):"]
        for code, thing in enumerate(self._listed):
            found = self._pick(thing)
            if found is None:
                continue
            if isinstance(found, Kernel):
                named[f"kernel_{code}"] = found
                found = f"kernel_{code}({', '.join(self._wanted(found, asked))})"
            lines += [f"    if {asked[0]} == {code}:", f"        return {found}"]
        lines.append(f"    return otherwise({', '.join(asked)})")
        return written(self._stub, "\n".join(lines), named)

    def _wanted(self, kernel: Kernel, asked: list[str]) -> list[str]:
        """The arguments of a kernel; TypeError where one is none of ours."""
        wanted = list(inspect.signature(kernel.py_func).parameters)
        strange = [name for name in wanted if name not in asked]
        if strange:
            name = kernel.py_func.__name__
            raise TypeError(f"{name} asks for {', '.join(strange)}; {self._stub.__name__} has {', '.join(asked)}")
        return wanted


def chosen(listed: Listed[T], pick: Callable[[T], Any], how: Callable[[F], F]) -> Callable[[F], F]:
    """Compile a function as a choice among the kernels of a list, and as what is called where there is none.

    pick: as of `Choice`; how: `jit.kernel`, `jit.part` or `jit.inline`.
    """

    def make(stub: F) -> F:
        return cast(F, Choice(cast(FunctionType, stub), listed, pick, how))

    return make
