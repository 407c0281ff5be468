"""Whether all that is private works as it is believed to: a function that needs all of it is compiled and called."""

import ctypes
from typing import Any

import numpy as np
from numba import types
from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]
from numba.core.runtime.nrt import MemInfo
from numba.experimental import structref

from mdstopo.compiler.numba_private.entry_code import build
from mdstopo.compiler.numba_private.libraries import LEFT, OPTIMISED
from mdstopo.compiler.numba_private.numba_functions import numba_object, outer
from mdstopo.compiler.numba_private.run_time import HEADER
from mdstopo.compiler.numba_private.taught import enter_structure, enter_threads, offer
from mdstopo.compiler.store import cache_folder, write_checked
from mdstopo.compiler.tried import UnexpectedError


def check() -> None:
    """Compile a function that uses what is private, and call it. Raises UnexpectedError where something is wrong.

    Once for these sources and versions on this machine.
    """
    passed = cache_folder() / "numba.checked"
    if passed.exists():
        return
    _check_header()
    _check_code(_probe())
    write_checked(passed, b"")


def _expect(clause: str, found: Any, expected: Any) -> None:
    if found != expected:
        raise UnexpectedError(f"{clause}: {found!r}, not {expected!r}")


def _check_header() -> None:
    """Whether an allocation of Numba's begins as one by `add_runtime` does."""
    size = 40
    address = _nrt_python.meminfo_alloc(size)
    held = MemInfo(address)
    words = (ctypes.c_int64 * (HEADER // 8)).from_address(address)
    found = words[0], words[3], words[4]
    _expect("the header of an allocation holds count, data, size as", found, (1, held.data, size))


def _probe_inner(x: Any, k: int) -> Any:
    made = np.zeros((3, x.shape[0]))
    for i in range(x.shape[0]):
        made[1, i] = k * x[i]
        made[-1, i] = made[1][i] + 1.0
    return made[1]


def _probe_pass(counter: Any, done: Any) -> None:
    k = _probe_taken(counter)
    while k < done.size:
        done[k] += k
        k = _probe_taken(counter)


def _probe_taken(counter: Any) -> int:
    raise NotImplementedError


def _probe_shared(kernel: Any, count: int, job: Any) -> None:
    raise NotImplementedError


def _probe_chosen(x: Any, k: int) -> Any:
    raise NotImplementedError


class _ProbePair:
    """What makes the structure of the probe."""

    row: Any
    table: Any

    def __init__(self, *_fields: Any) -> None: ...


class _ProbeStructure(types.StructRef):
    """Its type."""


class _Chosen:
    """What `offer` takes for a kernel."""

    def __init__(self, dispatcher: Any) -> None:
        self.dispatcher = dispatcher


def _probe() -> Any:
    """Numba's object for a function with all that our kernels have in them."""
    chosen = _Chosen(numba_object(_probe_inner, LEFT, frozenset(), False))
    shared_pass = numba_object(_probe_pass, OPTIMISED, frozenset({"nsz"}), False)
    offer(_probe_chosen, lambda _x, _k: chosen)
    enter_threads(_probe_shared, _probe_taken)
    structref.register(_ProbeStructure)
    enter_structure(_ProbePair, _ProbeStructure, ("row", "table"))

    def probe(tag, x, table, yes, counter, done, how):  # type: ignore[no-untyped-def]
        """What is compiled and then called to see whether machine code does what is written.

        tag: two integers; the second says how many copies a list gets.
        x (n,): numbers that another compiled function is called with.
        table (2, 2): its second entry is written.
        yes: a truth, a part of what comes back.
        counter (1,): what threads take pieces of work from.
        done (9,): what they write.
        how: 1 raises ValueError.
        """
        pair = _ProbePair(_probe_chosen(x, 2), table)
        row = pair.row
        if how == 1:
            raise ValueError("asked for")
        _probe_shared(shared_pass, 2, (counter, done))
        listed = [x[1:].copy()]
        for _ in range(tag[1]):
            listed.append(row.copy())  # noqa: PERF401  (one after another, so that it grows)
        pair.table.reshape(table.size)[1] = listed[-1].sum()
        return table[0, -1], len(listed) + done.sum(), yes and row[0] < 1.0

    return outer(probe, frozenset())


def _check_code(dispatcher: Any) -> None:
    """Whether that function's machine code does what is written."""
    from mdstopo.compiler.call import Native

    kinds = "t2 d1 d2 b q1 q1 i"
    made = build(dispatcher, kinds)
    if made is None:
        raise UnexpectedError("machine code asks for functions that it did not ask for before")
    native = Native("probe", made, kinds)
    x, table, counter, done = np.arange(4.0), np.zeros((2, 2)), np.zeros(1, np.int64), np.zeros(9, np.int64)
    given = (0, 50), x, table, True, counter, done
    _expect("a compiled function returned", native(*given, 0), (12.0, 51 + 36, True))
    _expect("and wrote", (done.tolist(), table.tolist()), (list(range(9)), [[0.0, 12.0], [0.0, 0.0]]))
    _expect("called once more, it returned", native.prepare(*given, 0)(), (12.0, 51 + 36, True))
    try:
        native(*given, 1)
    except ValueError as error:
        _expect("it raised", str(error), "asked for")
    else:
        raise UnexpectedError("what a compiled function raises does not arrive")
