"""The decorators that mark what is compiled, without compiling anything and without importing Numba.

A `kernel` is called by other kernels only. An `entry` is called from Python: at its first call its machine code is
read from the disk (`compiler.store`). Where it has never been compiled for these types of arguments on this machine,
Numba compiles it there and then, and the code is kept. So a process whose kernels are on the disk never imports Numba.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from mdstopo.compiler.entry import Entry
from mdstopo.compiler.kernel import Kernel, when_compiling

F = TypeVar("F", bound=Callable[..., Any])

# Sums may be reordered for the vector units and products fused; NaN and infinity keep their meaning.
_VECTOR = frozenset({"reassoc", "contract", "nsz"})


def entry(function: F) -> F:
    """Compile a function that Python calls: strict floating point."""
    return cast(F, Entry(function, frozenset()))


def vector_entry(function: F) -> F:
    """As `entry`, with loops of its own that are vectorised like a `member_kernel`'s."""
    return cast(F, Entry(function, _VECTOR))


def kernel(function: F) -> F:
    """Compile a function that other kernels call, at body level: strict floating point."""
    return cast(F, Kernel(function, frozenset()))


def part(function: F) -> F:
    """Compile a `kernel` into all that call it.

    An array is seven numbers or more on the stack, a model a hundred and more: what is given many of them, or runs
    shortly, spends as long on being called. What is called from several places and is long stays a `kernel`.
    """
    return cast(F, Kernel(function, frozenset(), part=True))


def member_kernel(function: F) -> F:
    """Compile a loop over members: sums vectorised, NaN and infinities honoured."""
    return cast(F, Kernel(function, _VECTOR))


def inline(function: F) -> F:
    """Compile a small scalar function that a member kernel inlines; the same arithmetic as there."""
    return cast(F, Kernel(function, _VECTOR))


def by_type(stub: Callable[..., Any], argument: str, choose: Callable[[Any], Any]) -> None:
    """Have kernels that call `stub` call the kernel that `choose` returns for the type of one of the arguments."""
    place = stub.__code__.co_varnames.index(argument)

    @when_compiling
    def register() -> None:
        from mdstopo.compiler.tried import way

        way().offer(stub, lambda *asked: choose(asked[place]))
