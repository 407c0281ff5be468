"""Instructions that do nothing are not written, and those that do something are."""

import ctypes
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest
from llvmlite import ir

from mdstopo.compiler.call import target
from mdstopo.compiler.instructions import Builder, prune
from mdstopo.compiler.jit import entry

WORD, PAIR = ir.IntType(64), ir.LiteralStructType([ir.IntType(64), ir.IntType(64)])


def written(fill: Callable[[Builder, Any], None], *arguments: Any) -> Any:
    """A function of integers, or other arguments, that `fill` writes."""
    module = ir.Module("written")
    function = ir.Function(module, ir.FunctionType(WORD, arguments or [WORD, WORD]), "written")
    build = Builder(function.append_basic_block())
    fill(build, function)
    prune(function)
    return function


def names(function: Any) -> list[str]:
    return [each.opname for block in function.blocks for each in block.instructions]


def result(function: Any, *given: int) -> int:
    """What it returns, compiled without passes."""
    engine = llvm.create_mcjit_compiler(
        llvm.parse_assembly(str(function.module)), target().create_target_machine(opt=0, jit=True)
    )
    call = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * len(given))
    return call(engine.get_function_address("written"))(*given)


def part(build: Builder, place: Any, k: int) -> Any:
    return build.gep(place, [ir.IntType(32)(0), ir.IntType(32)(k)])


def test_what_a_block_has_stored_is_not_read_again() -> None:
    def fill(build: Builder, function: Any) -> None:
        place = build.alloca(PAIR)
        build.store(PAIR(None), place)
        build.store(function.args[0], part(build, place, 0))
        build.store(function.args[1], part(build, place, 1))
        whole = build.load(place)
        build.ret(build.sub(build.extract_value(whole, 0), build.load(part(build, place, 1))))

    function = written(fill)
    assert names(function) == ["sub", "ret"]
    assert result(function, 7, 3) == 4


def test_a_later_store_counts_also_in_a_part() -> None:
    def fill(build: Builder, function: Any) -> None:
        place = build.alloca(PAIR)
        build.store(function.args[0], part(build, place, 1))
        build.store(PAIR(None), place)
        first = build.load(part(build, place, 1))
        build.store(function.args[1], part(build, place, 1))
        build.ret(build.add(first, build.load(part(build, place, 1))))

    assert result(written(fill), 7, 3) == 3


def by_call(build: Builder, function: Any, place: Any) -> None:
    other = ir.Function(function.module, ir.FunctionType(ir.VoidType(), [WORD.as_pointer()]), "other")
    inside = ir.IRBuilder(other.append_basic_block())
    inside.store(WORD(5), other.args[0])
    inside.ret_void()
    build.call(other, [place])


def by_cast(build: Builder, _function: Any, place: Any) -> None:
    build.store(WORD(5), build.inttoptr(build.ptrtoint(place, WORD), WORD.as_pointer()))


def by_choice(build: Builder, function: Any, place: Any) -> None:
    other = build.alloca(WORD)
    build.store(WORD(5), build.select(build.icmp_signed(">", function.args[1], WORD(0)), place, other))


def by_way(build: Builder, function: Any, place: Any) -> None:
    other, before = build.alloca(WORD), build.block
    with build.if_then(build.icmp_signed(">", function.args[1], WORD(0))):
        inside = build.block
    pointer = build.phi(WORD.as_pointer())
    pointer.add_incoming(other, before)
    pointer.add_incoming(place, inside)
    build.store(function.args[0], place)
    build.store(WORD(5), pointer)


def by_atomic_change(build: Builder, _function: Any, place: Any) -> None:
    build.atomic_rmw("xchg", place, WORD(5), "seq_cst")


def by_exchange(build: Builder, function: Any, place: Any) -> None:
    build.cmpxchg(place, function.args[0], WORD(5), "seq_cst")


def by_atomic_store(build: Builder, _function: Any, place: Any) -> None:
    build.store_atomic(WORD(5), place, "seq_cst", 8)


@pytest.mark.parametrize(
    "change", [by_call, by_cast, by_choice, by_way, by_atomic_change, by_exchange, by_atomic_store]
)
def test_a_place_that_others_know_of_is_read_again(change: Callable[[Builder, Any, Any], None]) -> None:
    def fill(build: Builder, function: Any) -> None:
        place = build.alloca(WORD)
        build.store(function.args[0], place)
        change(build, function, place)
        build.ret(build.load(place))

    assert result(written(fill), 7, 3) == 5


def test_what_another_block_reads_stays() -> None:
    def fill(build: Builder, function: Any) -> None:
        place, unread = build.alloca(WORD), build.alloca(WORD)
        build.store(function.args[0], place)
        build.store(function.args[0], unread)
        with build.if_then(build.icmp_signed(">", function.args[1], WORD(0))):
            build.store(function.args[1], place)
            build.store(function.args[1], unread)
        build.ret(build.load(place))

    function = written(fill)
    assert names(function).count("store") == 2
    assert [result(function, 7, 3), result(function, 7, -3)] == [3, 7]


def test_blocks_that_nothing_leads_to_are_left_out() -> None:
    def fill(build: Builder, function: Any) -> None:
        with build.if_else(build.icmp_signed("<", WORD(2), WORD(1))) as (then, otherwise):
            with then:
                one = build.mul(function.args[0], function.args[1])
                first = build.block
            with otherwise:
                other = build.mul(function.args[0], function.args[0])
                second = build.block
        found = build.phi(WORD)
        found.add_incoming(one, first)
        found.add_incoming(other, second)
        build.ret(found)

    function = written(fill)
    assert names(function).count("mul") == 1
    assert result(function, 7, 3) == 49


@pytest.mark.parametrize("goes", [False, True])
def test_a_value_by_the_way_knows_only_ways_that_are_left(goes: bool) -> None:
    def fill(build: Builder, function: Any) -> None:
        before = build.block
        with build.if_then(build.icmp_signed("<", WORD(1), WORD(2) if goes else WORD(0))):
            one = build.mul(function.args[0], function.args[1])
            inside = build.block
        found = build.phi(WORD)
        found.add_incoming(function.args[0], before)
        found.add_incoming(one, inside)
        build.ret(found)

    assert result(written(fill), 7, 3) == (21 if goes else 7)


def test_constants_are_computed_as_the_processor_does() -> None:
    most = WORD((1 << 63) - 1)

    def fill(build: Builder, function: Any) -> None:
        wrapped = build.add(most, WORD(1))
        product = build.mul(wrapped, WORD(-1))
        less = build.icmp_signed("<", product, build.sub(WORD(0), WORD(1)))
        build.ret(build.select(less, build.add(build.mul(function.args[0], WORD(1)), WORD(0)), function.args[1]))

    function = written(fill)
    assert names(function) == ["ret"]
    assert result(function, 7, 3) == 7


@entry
def walks(first, last, out):  # type: ignore[no-untyped-def]
    """Loops over ranges: what they visit, in this order."""
    k = 0
    for i in range(last):
        out[k] = i
        k += 1
    for i in range(first, last):
        for j in range(i, first, -1):
            out[k] = 10 * i + j
            k += 1
    for i in range(first, last, 2):
        out[k] = i
        k += 1
        if i > 4:
            break
    return k


@pytest.mark.parametrize(("first", "last"), [(0, 5), (2, 9), (3, 3), (4, -2), (-3, 4)])
def test_loops_visit_what_they_visit_in_python(first: int, last: int) -> None:
    found, expected = np.full(200, -1), np.full(200, -1)
    count = walks(first, last, found)
    assert count == walks.py_func(first, last, expected)  # type: ignore[attr-defined]
    assert np.array_equal(found, expected)


@entry
def cuts(x, y, first, last, out):  # type: ignore[no-untyped-def]
    """Slices of arrays in C order: how long they are, and what is in them."""
    k = 0
    for part in (x[first:last], x[:last], x[first:], y[1, first:last], y[1, :last], y[0, first:]):
        out[k] = part.size
        out[k + 1] = part.shape[0]
        out[k + 2] = part.sum()
        k += 3
    rows = y[first:last]
    out[k] = rows.size
    out[k + 1] = rows.shape[0]
    out[k + 2] = rows.shape[1]
    for i in range(rows.shape[0]):
        out[k + 3] += rows[i, 2] + rows[i][1]


@pytest.mark.parametrize("first", [-20, -6, -2, 0, 1, 5, 6, 20])
@pytest.mark.parametrize("last", [-20, -6, -1, 0, 2, 6, 20])
def test_slices_are_those_of_python(first: int, last: int) -> None:
    x, y = np.arange(6.0), np.arange(18.0).reshape(3, 6) ** 2
    found, expected = np.zeros(22), np.zeros(22)
    cuts(x, y, first, last, found)
    cuts.py_func(x, y, first, last, expected)  # type: ignore[attr-defined]
    assert np.array_equal(found, expected)
