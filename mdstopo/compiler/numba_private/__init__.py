"""Everything that is private or undocumented in Numba and llvmlite, as far as this program uses it. Imports Numba.

`tried` decides whether this package serves: it is imported only with versions that it was tried with, and `check` then
compiles and calls a function that needs all of it. Nothing outside this folder may name anything of `numba.core`,
`numba.np` or `numba.experimental.structref._Utils`; `tests/compiler` looks after that.

What fits only some of these versions asks for `LEAN` of `function_passes`. In the order in which a function meets it:
what it is for Numba (`numba_functions`); the target that it is compiled for (`own_target`), with our own ways to call
(`taught`) and without what takes long (`spared`); its passes (`function_passes`), of which one is the shorter way to
LLVM's code (`lean_lowering`); the library that holds this (`libraries`); the machine code of an entry (`entry_code`)
with the run time that it needs (`run_time`). `private_check` tries all of it.
"""

# here, while cffi and scipy are spared: see `kernel`
import numba.core.typing.cffi_utils
import numba.np.arraymath  # noqa: F401

from mdstopo.compiler.numba_private.entry_code import build
from mdstopo.compiler.numba_private.numba_functions import inner, outer, wrapped
from mdstopo.compiler.numba_private.own_target import enter_target
from mdstopo.compiler.numba_private.private_check import check
from mdstopo.compiler.numba_private.spared import spare_numba
from mdstopo.compiler.numba_private.taught import enter_structure, enter_threads, offer

__all__ = ["build", "check", "enter_structure", "enter_threads", "inner", "offer", "outer", "wrapped"]

enter_target()
spare_numba()
