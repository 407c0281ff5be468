"""What Numba is spared while it compiles changes nothing: types, values and errors are those that it comes to alone."""

import gc
import warnings

import numpy as np
import pytest
from llvmlite import binding as llvm

from mdstopo.compiler import tried
from mdstopo.compiler.jit import by_type, entry, kernel, member_kernel, vector_entry
from mdstopo.compiler.kernel import numba

pytestmark = pytest.mark.skipif(not tried.has_own_passes(), reason="Numba compiles with its own passes")


@kernel
def _sum(total, x):
    return total + x


@kernel
def _larger(x, k):
    return x * k if x > k else k


@entry
def widened(x, out):
    """What a kernel is given becomes a float in the second round, when what it returned is known."""
    total, most, other = 0, 0, 1
    for k in range(x.shape[0]):
        total = _sum(total, x[k])
        most = _larger(most, k)
        if k % 2 == 1:
            other = other + total
        other = other * 2
    out[0], out[1], out[2] = total, most, other


@entry
def in_turns(n, out):
    """Integers become floats through one another, over several rounds."""
    a, b, c = 1, 2, 3
    for _ in range(n):
        a, b, c = _sum(b, 1), _sum(c, a), _sum(a, 0.25) / 2
    out[0], out[1], out[2] = a, b, c


@entry
def mistaken(x):
    return _sum(x, None)


@pytest.mark.parametrize("program", [widened, in_turns], ids=["widened", "in_turns"])
def test_types_that_change_between_rounds_give_what_python_gives(program, monkeypatch) -> None:
    given = np.linspace(0.1, 2.3, 7) if program is widened else 9
    found, expected = np.zeros(3), np.zeros(3)
    program(given, found)
    for each in (_sum, _larger):
        monkeypatch.setitem(globals(), each.__name__, each.py_func)
    program.py_func(given, expected)
    assert found.tobytes() == expected.tobytes()


def test_an_error_tells_the_calls_that_it_happened_in() -> None:
    from numba.core.errors import TypingError

    with pytest.raises(TypingError) as told:
        mistaken(1.0)
    words = str(told.value)
    assert "unsupported operand" in words or "No implementation of function" in words
    assert "During: typing of intrinsic-call at" in words
    assert "During: resolving callee type: type(Dispatcher(<function _sum" in words
    assert words.count("During: Pass nopython_type_inference") == 2


@kernel
def _in_place(pair, k):
    return 10.0 * pair[k] + k


@entry
def with_numbers(x):
    """Numbers written in calls, alone and in a tuple, beside ones that are computed."""
    total = 0.0
    for k in range(2):
        total = _sum(total, _in_place((x, 2.0), k) + _in_place((3.0, x), 1))
    return total + _in_place((5, 7), 0) + _in_place((x, x), 1) + _in_place((1, 2), int(x))


def test_a_kernel_is_compiled_once_whatever_number_is_written_in_a_call() -> None:
    with_numbers.dispatcher.compile("(float64,)")
    assert len(_in_place.dispatcher.overloads) == 2  # of floats, of integers
    expected = 15.0 + 21.0 + 2 * 16.0 + 50.0 + 16.0 + 21.0
    assert with_numbers(1.5) == expected


def test_what_is_registered_between_compilations_is_found() -> None:
    from numba.core.errors import TypingError
    from numba.extending import overload

    def late(x):  # type: ignore[no-untyped-def]
        raise NotImplementedError

    def calls():  # type: ignore[no-untyped-def]
        @entry
        def call(x):  # type: ignore[no-untyped-def]
            return late(x)

        return call

    with pytest.raises(TypingError):
        calls().dispatcher.compile("(float64,)")

    @overload(late)
    def _late(x):  # type: ignore[no-untyped-def]
        return lambda x: 2.0 * x

    found = calls()
    found.dispatcher.compile("(float64,)")
    assert len(found.dispatcher.overloads) == 1


def test_cycles_are_looked_for_again_after_a_compilation() -> None:
    from mdstopo.compiler.kernel import way

    way()
    assert tried.private() is not None
    from mdstopo.compiler.numba_private import entry_code

    looked = []

    def fails() -> None:
        with entry_code._uncollected():
            looked.append(gc.isenabled())
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert looked == [False]
    assert gc.isenabled()


def test_no_type_of_numba_s_stands_for_others() -> None:
    """Classes of types are asked without what Python registers for abstract ones."""
    from numba import types

    from mdstopo.compiler.kernel import way

    way()
    assert isinstance(types.int64, types.Integer)
    assert not isinstance(types.int64, types.Float)
    assert isinstance(types.Array(types.float64, 2, "C"), types.Buffer)
    with pytest.raises(TypeError):
        isinstance(types.int64, "types.Integer")


@entry
def put(out, row):
    out[1:] = row


def test_numbers_of_another_size_are_refused() -> None:
    out = np.zeros(4)
    put(out, np.arange(1.0, 4.0))
    assert out.tolist() == [0.0, 1.0, 2.0, 3.0]
    with pytest.raises(ValueError, match="cannot assign slice from input of different size"):
        put(out, np.zeros(2))


@member_kernel
def _inner(x):
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * x[i]
    return total


@member_kernel
def _outer(x, y):
    return _inner(x) + 2.0 * _inner(y)


@vector_entry
def in_one(x, y):
    return _outer(x, y) - _inner(y)


@entry
def in_strict(x, y):
    return _outer(x, y) + _inner(y)


@pytest.mark.parametrize("split", ["", __name__], ids=["in one piece", "apart"])
def test_long_loops_are_optimised_once(split: str, monkeypatch) -> None:
    from mdstopo.compiler import compiled_units as units
    from mdstopo.compiler.call import Native
    from mdstopo.compiler.kernel import compile_anew, way

    way()
    compiles = tried.private()
    assert compiles is not None
    from mdstopo.compiler.numba_private import numba_functions

    monkeypatch.setattr(units, "LONG_FUNCTION", 1)
    monkeypatch.setattr(units, "_OURS", "_ZN")
    monkeypatch.setattr(units, "SPLIT", split or units.SPLIT)
    monkeypatch.setattr(units, "STAYING", (__name__,))
    optimised = []
    run = llvm.ModulePassManager.run

    def noted(self, module, builder):
        optimised.append([each.name for each in module.functions if not each.is_declaration])
        return run(self, module, builder)

    monkeypatch.setattr(llvm.ModulePassManager, "run", noted)
    x, y = np.arange(5.0), np.arange(3.0)
    monkeypatch.setattr(numba_functions.Cache, "load_overload", lambda *_: None)
    compile_anew()
    for program, expected in ((in_one, 35.0), (in_strict, 45.0)):
        code = compiles.build(program.dispatcher, "d1 d1")
        assert len(code.needs) == (2 if split and program is in_strict else 0)
        if not code.needs:
            assert Native("program", code, "d1 d1")(x, y) == expected
    passes = [sum(any("_inner" in name for name in names) for names in optimised)]
    passes += [sum(any("_outer" in name for name in names) for names in optimised)]
    assert passes == [2, 2]  # Numba makes two passes over a module


def _noted(x):
    """Stands for the kernel `_same`."""


@kernel
def _same(x):
    return x


def _choose(kind):
    warnings.warn(numba().NumbaWarning("slow"), stacklevel=1)
    return _same


by_type(_noted, "x", _choose)


@entry
def warned(x):
    return _noted(x) + 1.0


def test_what_is_warned_of_is_told_once_with_the_place_of_the_call() -> None:
    dispatcher = warned.dispatcher
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        tried.private().build(dispatcher, "f")
    place = warned.py_func.__code__.co_firstlineno + 2
    assert [(each.filename, each.lineno) for each in found] == [(__file__, place)]
    assert "slow" in str(found[0].message)
