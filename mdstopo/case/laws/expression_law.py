"""A law whose force and energy are formulas of the case."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from mdstopo.case.keys.formula_keys import FormulaText, why_no_name
from mdstopo.case.keys.kinds import NUMBER, Schema
from mdstopo.case.laws.law import Law, free_length_key
from mdstopo.case.text.nodes import MAPPING, Node
from mdstopo.case.text.reading import BAD, Fields, Reading, found
from mdstopo.case.text.words import inside
from mdstopo.case.value import Value, frozen, stated
from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.parser import WORD, parse
from mdstopo.formula.tree import names_in

if TYPE_CHECKING:
    from mdstopo.formula.law_formulas import Program

#: what a formula may use beside the law's parameters: elongation, its rate, time, length and free length
MOTION = ("x", "xd", "t", "l", "l0")
MOST_PARAMETERS = 7
_FORMULAS = ("force", "energy", "damping")


@frozen
class Parameters(Value):
    """The kind of a mapping from names that formulas use to numbers."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """Numbers by their names, or BAD with a mistake noted."""
        if node.kind != MAPPING:
            reading.mistake(path, f"found {found(node)}, allowed is a mapping from names to numbers", node)
            return BAD
        values = {}
        good = True
        for word, (key, value) in node.entries.items():
            here = inside(path, word)
            reading.mark(here, value, key)
            values[word] = NUMBER.read(value, here, reading)
            why = _why_not(word)
            if why:
                reading.mistake(here, why, key)
            good = good and not why and values[word] is not BAD
            reading.declare("law parameter", word)
        if len(values) > MOST_PARAMETERS:
            reading.mistake(path, f"found {len(values)} parameters, allowed are {MOST_PARAMETERS} at most", node)
            good = False
        return values if good else BAD

    def schema(self) -> Schema:
        """The JSON Schema: numbers by their names."""
        return {
            "type": "object", "propertyNames": {"pattern": f"^{WORD.pattern}$"}, "maxProperties": MOST_PARAMETERS,
            "additionalProperties": NUMBER.schema(),
        }  # fmt: skip


def _why_not(word: str) -> str:
    """Why a parameter cannot be called so; nothing where it can."""
    why = why_no_name(word, MOTION, f"the name {word!r} is taken: it means something in every formula of a law")
    if not why and (hasattr(OfFormulas, word) or word.startswith("__")):
        return f"the name {word!r} is used by the program, choose another"
    return why


@frozen(kw_only=True)
class OfFormulas(Law):
    """A law of formulas, of which subclasses have the parameters as fields (`class_with`)."""

    type: ClassVar[str] = "expression"
    kind: ClassVar[str] = "active"
    doc: ClassVar[str] = (
        "Any: force and energy are [expressions](expressions.md#laws) of elongation, rate, time, length and the law's "
        "parameters. Kinks and jumps are located in time."
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.expression"
    may_lack_slopes: ClassVar[bool] = True

    force: str | None = stated(
        FormulaText(),
        "f at alpha = 1, an expression of x (Delta, m), xd (its rate, m/s), t (s), l, l0 (m) and the parameters",
        unit="N",
        default=None,
        otherwise="the energy's slope by x, plus `damping`",
    )
    energy: str | None = stated(
        FormulaText(("xd", "t"), "stored energy is of the elongation alone"),
        "what it stores at alpha = 1, an expression of x, l, l0 and the parameters",
        unit="J",
        default=None,
        otherwise="none",
    )
    damping: str | None = stated(
        FormulaText(),
        "a force that is added to the slope of the energy, for example c*xd",
        unit="N",
        default=None,
        otherwise="none",
    )
    free_length: float | None = free_length_key()

    @property
    def values(self) -> dict[str, float]:
        """The values of the parameters that the formulas use."""
        return {word: getattr(self, word) for word in names_of(type(self))}

    @property
    def formulas(self) -> tuple[str | None, str | None, str | None]:
        """The formulas that the case states: force, energy and damping."""
        return self.force, self.energy, self.damping

    @property
    def program(self) -> Program:
        """The law's formulas with their derivatives, ready for kernels."""
        from mdstopo.formula.law_formulas import program  # most cases have no formulas

        return program(*self.formulas, names_of(type(self)))

    @property
    def too_large(self) -> str:
        """Why the formulas are too large to be used; empty where they are not."""
        from mdstopo.formula.law_formulas import why_too_large  # most cases have no formulas

        return why_too_large(lambda: self.program.groups)

    @property
    def depends_on_rate(self) -> bool:
        """Whether a formula of the force has the rate of elongation in it."""
        return any("xd" in names_in(parse(text).root) for text in self.formulas if text is not None)

    def stated_times(self, factor: float) -> dict[str, Any]:
        """The law multiplied by a factor, as a mapping of the case file."""
        stated: dict[str, Any] = {"type": self.type}
        for key, text in zip(_FORMULAS, self.formulas, strict=True):
            if text is not None:
                stated[key] = text if factor == 1.0 else f"{factor!r} * ({text})"
        if self.values:
            stated["parameters"] = self.values
        common = ("free_length", "active_from", "active_until")
        return stated | {key: getattr(self, key) for key in common if getattr(self, key) is not None}

    def __reduce__(self) -> tuple[Any, ...]:
        own = {key: getattr(self, key) for key in (*_FORMULAS, "free_length", "active_from", "active_until")}
        return with_parameters, (own, self.values)


@functools.cache
def class_with(names: tuple[str, ...]) -> type[OfFormulas]:
    """The class of expression laws whose parameters have these names."""
    fields = {word: stated(NUMBER, f"the parameter {word}", varies=True) for word in names}
    body = {"__annotations__": dict.fromkeys(names, "float"), "__module__": __name__, "__doc__": OfFormulas.__doc__}
    made: type[OfFormulas] = frozen(kw_only=True)(type("OfFormulas", (OfFormulas,), {**fields, **body}))
    return made


def names_of(law: type[Law]) -> tuple[str, ...]:
    """The names of the parameters of a class that `class_with` has made."""
    common = OfFormulas.__dataclass_fields__
    return tuple(word for word in law.__dataclass_fields__ if word not in common)


def with_parameters(own: Mapping[str, Any], parameters: Mapping[str, float]) -> OfFormulas:
    """A copy of a law with these formulas and parameters."""
    values: dict[str, Any] = {**own, **parameters}
    return class_with(tuple(parameters))(**values)


@frozen(kw_only=True)
class ExpressionLaw(OfFormulas):
    """The keys of a law of formulas in the case file; what is made of them is `with_parameters`."""

    parameters: Mapping[str, float] | None = stated(
        Parameters(),
        f"names of numbers in the formulas, {MOST_PARAMETERS} at most; each may be a design variable",
        unit="yours",
        default=None,
        otherwise="none",
    )

    @classmethod
    def made(cls, fields: Fields, values: dict[str, Any], reading: Reading) -> Law | None:
        """The law of what was read; None where formulas do not go together, which is noted."""
        parameters = values.pop("parameters") or {}
        good = True
        if values["force"] is None and values["energy"] is None:
            reading.mistake(fields.path, "found neither 'force' nor 'energy', needed is one of them, or both")
            good = False
        if values["damping"] is not None and (values["force"] is not None or values["energy"] is None):
            why = "goes with `energy` alone; a force has its damping in it"
            reading.mistake(inside(fields.path, "damping"), f"the key 'damping' {why}")
            good = False
        for key in _FORMULAS:
            if values[key] is None:
                continue
            try:
                parse(values[key], (*MOTION, *parameters))
            except FormulaError as error:
                reading.mistake(inside(fields.path, key), str(error))
                good = False
        law = with_parameters(values, parameters) if good else None
        why = law.too_large if law is not None else ""
        if why:
            reading.mistake(fields.path, why)
        return law if not why else None
