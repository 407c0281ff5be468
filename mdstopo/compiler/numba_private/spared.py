"""What Numba is spared while it compiles: what it asks again and again, and what nobody wants to know.

It asks what the sum of two floats is, trying dozens of candidates each time. Some of it is spared for our target alone
(`own_target`), the rest is found out in fewer steps by whoever asks.
"""

import functools
import hashlib
import math
import warnings
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

import numba
import numba.np.arrayobj
import numpy as np
from llvmlite import ir as llvm_ir
from numba import types
from numba.core import (
    base,
    consts,
    cpu_options,
    errors,
    interpreter,
    ir,
    itanium_mangler,
    lowering,
    postproc,
    targetconfig,
    typeinfer,
    utils,
)
from numba.extending import overload

from mdstopo.compiler.numba_private.function_passes import LEAN, canonicalise
from mdstopo.compiler.numba_private.own_target import TARGET, Dispatcher

#: of what is not typed
_ERRORS: Any = errors
_LASTING = (types.Number, types.Boolean, types.Literal, types.Array, types.BaseTuple)


def _enter_sizes() -> None:
    """What is said where a part of an array is given numbers of another size, without the sizes: how they are written
    would be compiled in every process."""

    def without(given: Any, place: Any) -> Any:
        def impl(given: Any, place: Any) -> None:
            raise ValueError("cannot assign slice from input of different size")

        return impl

    arrays: Any = numba.np.arrayobj
    overload(arrays.raise_with_shape_context, target=TARGET)(without)


def _spare_registries() -> None:
    """Before every function Numba imports all that may have something to register: at the first one is enough, and
    then what has been registered since, if anything was, is taken from those that it came to."""
    for context in (Dispatcher.targetdescr.typing_context, Dispatcher.targetdescr.target_context):
        _load_once(context)


def _load_once(context: Any) -> None:
    whole = context.load_additional_registries
    known: list[Any] = []
    lists: list[Any] = []
    count = 0

    def load() -> None:
        nonlocal count
        if not known:
            whole()
            known.extend(context._registries)
            lists.extend(getattr(each, name) for each in known for name in context._registries[each].registry_items)
        now = sum(map(len, lists))
        if now != count:
            count = now
            for each in known:
                context.install_registry(each)

    context.load_additional_registries = load


def _remember_signatures() -> None:
    """What operators give for numbers, arrays and tuples of them is looked for once."""
    function: Any = types.Function
    ask = function.get_call_type
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, asked: Any, named: Any) -> Any:
        lasting = _is_operator(self.typing_key)
        ours = context is Dispatcher.targetdescr.typing_context
        if not (lasting and ours) or named or not all(isinstance(each, _LASTING) for each in asked):
            return ask(self, context, asked, named)
        key = self, asked if isinstance(asked, tuple) else tuple(asked)
        found = known.get(key)
        if found is None:
            found = known[key] = ask(self, context, asked, named)
        return found

    function.get_call_type = get_call_type


def _name_flags_in_order() -> None:
    """Symbols have the flags of fast arithmetic in them: sorted, because the order of a set differs by process."""
    options: Any = cpu_options.FastMathOptions
    options.encode = lambda self: str(sorted(self.flags))


def _shorten_symbols() -> None:
    """A structure is in the symbols of all functions that are given one: by a hash of its name, which has the types of
    all its fields."""
    structure: Any = types.StructRef
    structure.mangling_args = property(
        lambda self: (f"{type(self).__name__}_{hashlib.sha256(self.name.encode()).hexdigest()[:16]}", ())
    )


def _spare_flags() -> None:
    """Flags of functions are looked up and compared at every call, option by option. Of those that were set only the
    ones count that differ from the defaults."""
    config: Any = targetconfig.TargetConfig

    @functools.cache
    def defaults(kind: Any) -> dict[str, Any]:
        return {key: option.default for key, option in kind.options.items()}

    def values(self: Any) -> dict[str, Any]:
        return {**defaults(self.__class__), **self._values}

    def changed(self: Any) -> dict[str, Any]:
        usual = defaults(self.__class__)
        return {key: value for key, value in self._values.items() if value != usual[key]}

    def is_equal(self: Any, other: Any) -> Any:
        if not isinstance(other, config):
            return NotImplemented
        if type(self) is not type(other):
            return self.values() == other.values()
        return self._values == other._values or changed(self) == changed(other)

    @functools.cache
    def hash_of(kind: Any) -> int:
        return hash(tuple(kind.options))

    config.values, config.__eq__, config.__hash__ = values, is_equal, lambda self: hash_of(self.__class__)


def _spare_variables() -> None:
    """Which variables a statement mentions is asked again and again: what by its type can hold none is passed over."""
    instruction: Any = ir.Inst
    found_in, variable, expression = instruction._rec_list_vars, ir.Var, ir.Expr
    others = frozenset({ir.Loc, ir.Const, ir.Global, ir.FreeVar, ir.Arg, str, int, float, bool, type(None)})
    others |= {BuiltinFunctionType, FunctionType}

    def variables(self: Any, held: Any) -> list[Any]:
        kind = type(held)
        if kind is variable:
            return [held]
        if kind in others:
            return []
        if kind is expression:
            held, kind = held._kws, dict
        if kind is not dict and kind is not tuple and kind is not list:
            return list(found_in(self, held))
        found = []
        for each in held.values() if kind is dict else held:
            if type(each) is variable:
                found.append(each)
            elif type(each) not in others:
                found += variables(self, each)
        return found

    instruction._rec_list_vars = variables


def _spare_globals() -> None:
    """A function or module that a kernel names is looked for first among those that Numba knows: it is nothing else."""
    context: Any = Dispatcher.targetdescr.typing_context
    ask, known = context.resolve_value_type, context._get_global_type

    def resolve(value: Any) -> Any:
        if isinstance(value, (FunctionType, BuiltinFunctionType, ModuleType)) and not hasattr(value, "_numba_type_"):
            found = known(value)
            if found is not None:
                return found
        return ask(value)

    context.resolve_value_type = resolve


def _spare_attributes() -> None:
    """Of which type an attribute of a structure or of NumPy is, is looked for once, and not in every round of type
    inference."""
    context: Any = Dispatcher.targetdescr.typing_context
    ask = context.resolve_getattr
    lasting = math, np
    known: dict[tuple[int, str], Any] = {}  # by the type's place in memory: its hash goes through all its fields

    def resolve(kind: Any, name: str) -> Any:
        if not (isinstance(kind, types.StructRef) or (isinstance(kind, types.Module) and kind.pymod in lasting)):
            return ask(kind, name)
        key = id(kind), name
        if key not in known:
            found = ask(kind, name)
            if found is None:
                return None
            known[key] = kind, found  # the type lives on, and nothing else comes to its place
        return known[key][1]

    context.resolve_getattr = resolve


def _spare_exits() -> None:
    """What ends a `with` is taken out of functions that have one; in others it need not be looked for."""
    translation: Any = interpreter
    whole = translation.peep_hole_delete_with_exit

    def remove(function: Any) -> Any:
        has_one = any(isinstance(each, ir.EnterWith) for block in function.blocks.values() for each in block.body)
        return whole(function) if has_one else function

    translation.peep_hole_delete_with_exit = remove


def _spare_lifetimes() -> None:
    """After most passes over a function nobody asks which variables live where: it is found out when somebody does."""
    processor: Any = postproc.PostProcessor
    whole = processor.run

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        function = self.func_ir
        if emit_dels or function.is_generator:
            whole(self, emit_dels, extend_lifetimes)
            return
        canonicalise(function)
        function.variable_lifetime = postproc.VariableLifetime(function.blocks)
        function.generator_info = None

    processor.run = run


def _spare_failures() -> None:
    """Numba asks of every index whether it is constant, and is told by an error where it is not: one that is no text
    with the lines of the source."""

    def begin(self: Any, value: Any, loc: Any = None) -> None:
        Exception.__init__(self, value)
        self.msg, self.loc = value, loc

    def fail(_self: Any, value: Any) -> Any:
        raise _ERRORS.ConstantInferenceError(value)

    inference: Any = consts.ConstantInference
    _ERRORS.ConstantInferenceError.__init__, inference._fail = begin, fail


def _spare_classes() -> None:
    """Classes of types are abstract ones, of which Python asks what else was registered for them: nothing is."""
    kind: Any = type(types.Type)
    kind.__instancecheck__ = type.__instancecheck__


def _spare_contexts() -> None:
    """What an error is told to have happened in is put together where there is an error."""
    given: Any = _ERRORS.new_error_context

    class Context:
        """In the place of Numba's context of an error, which it makes only where an error is raised."""

        __slots__ = ("_named", "_parts")

        def __init__(self, *parts: Any, **named: Any) -> None:
            self._parts, self._named = parts, named
            place = named.get("loc")
            if place is not None and not place.filename.startswith(_ERRORS._numba_path):
                _ERRORS.loc_info.update(named)

        def __enter__(self) -> None:
            pass

        def __exit__(self, kind: Any, error: Any, trace: Any) -> Any:
            if kind is None:
                return None
            told = given(*self._parts, **self._named)
            told.__enter__()
            return told.__exit__(kind, error, trace)

    modules: list[Any] = [errors, typeinfer, lowering]
    for module in modules:
        module.new_error_context = Context


def _spare_ranges() -> None:
    """Lengths are said to be positive where they are read from memory; ours may come from elsewhere."""
    arrays: Any = numba.np.arrayobj
    say = arrays.set_range_metadata

    def said(build: Any, value: Any, *bounds: Any) -> None:
        if isinstance(value, llvm_ir.LoadInstr):
            say(build, value, *bounds)

    arrays.set_range_metadata = said


def _spare_places() -> None:
    """Whether a function takes `loc` is seen in its code; what is made of others is asked as before."""
    implementations: Any = base
    ask = implementations._has_loc

    def has(function: Any) -> bool:
        code = getattr(function, "__code__", None)
        if code is None or hasattr(function, "__wrapped__") or hasattr(function, "__signature__"):
            return bool(ask(function))
        return "loc" in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

    implementations._has_loc = has


class _Settled:
    """A call in rounds of `_spare_rounds`."""

    __slots__ = ("call", "known", "names")

    def __init__(self, call: Any) -> None:
        self.call = call
        self.known: list[Any] | None = None
        given = [*call.args, *dict(call.kws).values()] + ([] if call.vararg is None else [call.vararg])
        self.names = [call.target, *(each.name for each in given)]
        if type(call) is typeinfer.CallConstraint:
            self.names.append(call.func)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.call, name)

    def __call__(self, infer: Any) -> None:
        if infer.context is not Dispatcher.targetdescr.typing_context:
            self.call(infer)
        elif self.known is None or self.known != self._types(infer):
            self.known = None
            self.call(infer)
            found, now = self.call.signature, self._types(infer)
            if found is not None and found.return_type.is_precise() and self._lasts(now):
                self.known = now

    def _types(self, infer: Any) -> list[Any]:
        """Of what it returns, of what it is given, and where it has a name of what is called."""
        return [infer.typevars[name].type for name in self.names]

    def _lasts(self, now: list[Any]) -> bool:
        """Whether the same is found for the same types, whenever it is looked for."""
        if type(self.call) is typeinfer.CallConstraint:
            return isinstance(now[-1], types.Dispatcher)
        return all(isinstance(each, _LASTING) for each in now)


def _spare_rounds() -> None:
    """Types are inferred in rounds until nothing changes. A call of one of our kernels, or of an operator, is not
    looked up once more where what it is given and what it is known to return are as they were after it was.

    Functions of Numba's own are: which one is called where several fit is what was looked up last.
    """
    network: Any = typeinfer.ConstraintNetwork
    called, operated = typeinfer.CallConstraint, typeinfer.IntrinsicCallConstraint

    def append(self: Any, constraint: Any) -> None:
        lasts = type(constraint) is called or (type(constraint) is operated and _is_operator(constraint.func))
        self.constraints.append(_Settled(constraint) if lasts else constraint)

    network.append = append


def _spare_warnings() -> None:
    """In every round of type inference Numba catches the warnings of each rule in a context of Python's of its own. One
    context for a round is enough, where after each rule it is seen whether it has warned."""
    network: Any = typeinfer.ConstraintNetwork

    def propagate(self: Any, infer: Any) -> list[Any]:
        found: list[Any] = []
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", _ERRORS.NumbaWarning)
            for constraint in self.constraints:
                try:
                    constraint(infer)
                except _ERRORS.ForceLiteralArg as error:
                    found.append(error)
                except _ERRORS.TypingError as error:
                    located = _ERRORS.TypingError(str(error), loc=constraint.loc, highlighting=False)
                    found.append(utils.chain_exception(located, error))
                if told:
                    _tell(infer, constraint.loc, told)
        return found

    network.propagate = propagate


def _tell(infer: Any, loc: Any, told: list[Any]) -> None:
    """Hand on what a rule at a place has warned of, as if it had been alone."""
    now = told[:]
    told.clear()
    with infer.warnings.catch_warnings(filename=loc.filename, lineno=loc.line):
        for each in now:
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)


def _spare_literals() -> None:
    """Whether a value has a type of its own is looked up. Numba asks it of both sides of every operator, twice, though
    most have no value yet, and each time makes an error to find that out."""
    constants: Any = types
    lowered: Any = lowering
    makers, literal, unknown = constants.Literal.ctor_map, constants.literal, types.Omitted(ir.UNDEFINED)

    def literal_or_omitted(value: Any) -> Any:
        if value is ir.UNDEFINED:
            return unknown
        return literal(value) if type(value) in makers else types.Omitted(value)

    def maybe_literal(value: Any) -> Any:
        known = type(value) in makers or isinstance(value, types.Literal)  # of the latter it says what is wrong
        return literal(value) if known else None

    lowered._lit_or_omitted = literal_or_omitted
    constants.maybe_literal = maybe_literal


def _is_operator(function: Any) -> bool:
    return getattr(function, "__module__", None) == "_operator"


def spare_numba() -> None:
    """Take the shorter ways, as far as they fit this version. Done once, when `numba_private` is imported."""
    _name_flags_in_order()
    if not LEAN:
        return
    _enter_sizes()
    _shorten_symbols()
    _spare_registries()
    _remember_signatures()
    _spare_flags()
    _spare_variables()
    _spare_attributes()
    _spare_exits()
    _spare_lifetimes()
    _spare_failures()
    _spare_globals()
    _spare_classes()
    _spare_contexts()
    _spare_places()
    _spare_ranges()
    _spare_rounds()
    _spare_warnings()
    _spare_literals()
    names: Any = itanium_mangler
    names._escape_string = functools.lru_cache(1 << 16)(names._escape_string)
