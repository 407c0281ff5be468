"""What compiled code expects of Numba's run time: memory that counts who holds it, and the shapes of views.

Numba's own is reached by importing Numba. These few functions do the same on the memory of C, and are kept with the
code. An allocation begins with Numba's header (count, destructor, its information, data, size, allocator), of which
the code itself reads the count and the place of the data.
"""

from typing import Any

from llvmlite import ir as llvm_ir

#: what `add_runtime` defines
PROVIDED = frozenset(
    {
        "NRT_Allocate",
        "NRT_Free",
        "NRT_MemInfo_alloc",
        "NRT_MemInfo_alloc_aligned",
        "NRT_MemInfo_alloc_dtor",
        "NRT_MemInfo_call_dtor",
        "NRT_MemInfo_new_varsize_dtor",
        "NRT_MemInfo_varsize_realloc",
        "numba_attempt_nocopy_reshape",
    }
)
HEADER = 48


def add_runtime(module: Any) -> None:
    """Define `PROVIDED` in a module of llvmlite.code."""
    byte, word, small = llvm_ir.IntType(8), llvm_ir.IntType(64), llvm_ir.IntType(32)
    memory = byte.as_pointer()
    nothing = llvm_ir.VoidType()
    malloc = llvm_ir.Function(module, llvm_ir.FunctionType(memory, [word]), "malloc")
    realloc = llvm_ir.Function(module, llvm_ir.FunctionType(memory, [memory, word]), "realloc")
    free = llvm_ir.Function(module, llvm_ir.FunctionType(nothing, [memory]), "free")
    destructor = llvm_ir.FunctionType(nothing, [memory, word, memory]).as_pointer()

    def define(name: str, result: Any, arguments: list[Any]) -> tuple[Any, Any]:
        function = llvm_ir.Function(module, llvm_ir.FunctionType(result, arguments), name)
        return function, llvm_ir.IRBuilder(function.append_basic_block())

    def field(build: Any, header: Any, k: int, kind: Any) -> Any:
        return build.bitcast(build.gep(header, [word(8 * k)]), kind.as_pointer())

    def checked(build: Any, address: Any) -> Any:
        """An address; null ends the function with null: there is no memory."""
        with build.if_then(build.icmp_unsigned("==", address, memory(None))):
            build.ret(memory(None))
        return address

    def enter(build: Any, header: Any, data: Any, size: Any, made_by: Any) -> None:
        values = word(1), made_by, memory(None), data, size, memory(None)
        for k, value in enumerate(values):
            build.store(value, field(build, header, k, value.type))

    def allocate(build: Any, size: Any, align: Any, made_by: Any) -> None:
        """Header and data in one piece, the data at a multiple of `align`."""
        header = checked(build, build.call(malloc, [build.add(size, build.add(align, word(HEADER)))]))
        least = build.add(build.ptrtoint(header, word), word(HEADER))
        data = build.and_(build.add(least, build.sub(align, word(1))), build.neg(align))
        enter(build, header, build.inttoptr(data, memory), size, made_by)
        build.ret(header)

    function, build = define("NRT_Allocate", memory, [word])
    build.ret(build.call(malloc, [function.args[0]]))

    function, build = define("NRT_Free", nothing, [memory])
    build.call(free, [function.args[0]])
    build.ret_void()

    function, build = define("NRT_MemInfo_alloc", memory, [word])
    allocate(build, function.args[0], word(16), destructor(None))

    function, build = define("NRT_MemInfo_alloc_aligned", memory, [word, small])
    allocate(build, function.args[0], build.zext(function.args[1], word), destructor(None))

    function, build = define("NRT_MemInfo_alloc_dtor", memory, [word, destructor])
    allocate(build, function.args[0], word(16), function.args[1])

    # a list: its data apart from the header, where it can grow
    loose, build = define("mdstopo_free_list", nothing, [memory, word, memory])
    of_items = llvm_ir.FunctionType(nothing, [memory]).as_pointer()
    with build.if_then(build.icmp_unsigned("!=", loose.args[2], memory(None))):
        build.call(build.bitcast(loose.args[2], of_items), [loose.args[0]])
    build.call(free, [loose.args[0]])
    build.ret_void()

    function, build = define("NRT_MemInfo_new_varsize_dtor", memory, [word, memory])
    data = checked(build, build.call(malloc, [function.args[0]]))
    header = checked(build, build.call(malloc, [word(HEADER)]))
    enter(build, header, data, function.args[0], loose)
    build.store(function.args[1], field(build, header, 2, memory))
    build.ret(header)

    function, build = define("NRT_MemInfo_varsize_realloc", memory, [memory, word])
    header, size = function.args
    data = checked(build, build.call(realloc, [build.load(field(build, header, 3, memory)), size]))
    build.store(data, field(build, header, 3, memory))
    build.store(size, field(build, header, 4, word))
    build.ret(data)

    function, build = define("NRT_MemInfo_call_dtor", nothing, [memory])
    header = function.args[0]
    called = build.load(field(build, header, 1, destructor))
    with build.if_then(build.icmp_unsigned("!=", called, destructor(None))):
        parts = [(3, memory), (4, word), (2, memory)]
        build.call(called, [build.load(field(build, header, k, kind)) for k, kind in parts])
    build.call(free, [header])
    build.ret_void()

    _reshape(*define(
        "numba_attempt_nocopy_reshape",
        small,
        [word, word.as_pointer(), word.as_pointer(), word, word.as_pointer(), word.as_pointer(), word, small],
    ))  # fmt: skip


def _reshape(function: Any, build: Any) -> None:
    """Strides of a view in C order of another shape; 0 where the array does not lie in C order, or has another size."""
    word, small = llvm_ir.IntType(64), llvm_ir.IntType(32)
    n, shape, strides, n_new, shape_new, strides_new, item, fortran = function.args
    with build.if_then(build.icmp_signed("!=", fortran, small(0))):
        build.ret(small(0))

    def from_last(count: Any, visit: Any) -> Any:
        """Run through the dimensions from the last; `visit(k, stride)` sees each; the size in bytes comes out."""
        place, stride = build.alloca(word), build.alloca(word)
        build.store(count, place)
        build.store(item, stride)
        head, body, after = (build.append_basic_block() for _ in range(3))
        build.branch(head)
        build.position_at_end(head)
        build.cbranch(build.icmp_signed(">", build.load(place), word(0)), body, after)
        build.position_at_end(body)
        k = build.sub(build.load(place), word(1))
        build.store(k, place)
        build.store(build.mul(build.load(stride), visit(k, build.load(stride))), stride)
        build.branch(head)
        build.position_at_end(after)
        return build.load(stride)

    def length(k: Any, stride: Any) -> Any:
        return build.load(build.gep(shape, [k]))

    def checked(k: Any, stride: Any) -> Any:
        size = build.load(build.gep(shape, [k]))
        other = build.icmp_signed("!=", build.load(build.gep(strides, [k])), stride)
        with build.if_then(build.and_(other, build.icmp_signed("!=", size, word(1)))):
            build.ret(small(0))
        return size

    def entered(k: Any, stride: Any) -> Any:
        build.store(stride, build.gep(strides_new, [k]))
        return build.load(build.gep(shape_new, [k]))

    full = build.icmp_signed("!=", from_last(n, length), word(0))
    with build.if_then(full):  # an array without elements lies in any order
        from_last(n, checked)
    same = build.icmp_signed("==", from_last(n, length), from_last(n_new, entered))
    build.ret(build.zext(same, small))
