"""Format 1 of the case file: every key, its type, limits, words, default and meaning.

The single source of the reader's checks and of the JSON Schema. What cannot be said of one value alone (names
that must be declared, sums, lengths) is checked where the case is built.
"""

from __future__ import annotations

from typing import Any

from mdstopo.case.keys.common_keys import GROUP, PAIR
from mdstopo.case.keys.definitions import DEFINED_NAME, Definitions
from mdstopo.case.keys.kinds import (
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    Flag,
    Number,
    OneOf,
    OpenWord,
    Ref,
    Schema,
    Text,
    Version,
    explained,
)
from mdstopo.case.keys.number_rows import FileName
from mdstopo.case.keys.records import ByName, ByShape, Key, ListOf, Named, Record
from mdstopo.case.methods.integrators import names as integrators
from mdstopo.case.methods.over_time import DEFAULT_REDUCTION
from mdstopo.case.methods.over_time import names as reductions
from mdstopo.case.methods.sensitivities import AUTO_SENSITIVITY
from mdstopo.case.methods.sensitivities import names as sensitivities
from mdstopo.case.responses.response_kinds import (
    IN_SPACE_ALONE,
    MATERIAL,
    NO_RESPONSE,
    OF_OTHERS,
    RESPONSES,
    response_kinds,
    unit_stated,
)
from mdstopo.case.schema.schema_contact import CONTACT
from mdstopo.case.schema.schema_fit import fit_record
from mdstopo.case.schema.schema_scene import (
    BODY_KEYS,
    BUSHING,
    GROUP_KEYS,
    JOINT,
    LOAD_CASE,
    LOADS,
    MOTIONS,
    POINTS,
    parameter_words,
)
from mdstopo.case.schema.schema_uncertainty import UNCERTAINTY
from mdstopo.case.text.nodes import SCALAR, Node
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import listed
from mdstopo.case.value import frozen
from mdstopo.settings.optimizer_options import OPTIONS
from mdstopo.settings.optimizer_presets import DEFAULT_OPTIMIZER, PRESETS
from mdstopo.settings.optimizers import names as optimizers
from mdstopo.settings.scalarisations import DEFAULT_SCALARISATION, taking_exponent
from mdstopo.settings.scalarisations import names as scalarisations

# Design, objectives, constraints.


def _design(name: str, number: Number, doc: str, default: float) -> Key:
    by_group = ByName("member group", number, "number")
    kind = ByShape("a number or {group: number}", scalar=number, mapping=by_group)
    return Key(name, kind, doc + "; a number or {group: number}", default=default)


_POWERS = ListOf(POSITIVE, 1, "powers")
_OF_A_GROUP = ByShape("a number or a list of numbers", scalar=POSITIVE, sequence=_POWERS)
_POWER = Key(
    "power",
    ByShape(
        "a number, a list of numbers or {group: number or list}",
        scalar=POSITIVE,
        sequence=_POWERS,
        mapping=ByName("member group", _OF_A_GROUP, "number or list"),
    ),
    "mu of Eq. 12: a member's force is alpha^mu times its law's; a number, a list or {group: number or list}. `run` "
    "goes through a list, which rises, from one optimum to the next; everything else takes its last",
    default=1.0,
)


_SIZES = ListOf(Number(minimum=0, maximum=1), 1, "sizes")
_CATALOGUE = Record(
    "a catalogue",
    (
        Key("sizes", _SIZES, "what alpha of a member can be, rising; 0 is no member", required=True),
        Key(
            "prices",
            ListOf(NOT_NEGATIVE, 1, "prices"),
            "of each size what volume rows have in the place of alpha",
            otherwise="the sizes themselves",
        ),
    ),
    doc="Sizes that members can be bought in.",
)


@frozen
class ParameterWord(OpenWord):
    """The kind of a name of a law's parameter; those of formulas have the names that the case gives them."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The name of the parameter at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if isinstance(value, str) and value in reading.declared.get("law parameter", ()):
            return value
        return OpenWord(self.words, self.instead, self.meanings, self.anew).read(node, path, reading)

    def schema(self) -> Schema:
        """The JSON Schema: the words that are known, or any other."""
        known = OpenWord(self.words, self.instead, self.meanings, self.anew).schema()
        return {"anyOf": [known, {"type": "string", "description": "a parameter of a law of formulas"}]}


_PARAMETER = ParameterWord(tuple(parameter_words()), "", tuple(parameter_words().values()), parameter_words)
_VARIABLE = Record(
    "a design variable",
    (
        Key(
            "group",
            ByShape(
                "a member group or a list of member groups", scalar=GROUP, sequence=ListOf(GROUP, 1, "member groups")
            ),
            "whose law it is; of several groups, all have the same values",
            otherwise="a defined name is meant, with `of`",
        ),
        Key("parameter", _PARAMETER, "which key of the law varies; needed beside `group`"),
        Key(
            "of",
            DEFINED_NAME,
            "a name in `define` that varies, `define.k`, and with it every number that is an expression of it",
            otherwise="a parameter of laws is meant, with `group`",
        ),
        Key(
            "law",
            Number(minimum=0, whole=True),
            "where the group has a list of laws: which of them, from 0",
            otherwise="the only one that has the parameter",
        ),
        Key(
            "each",
            explained({"group": "one value for all members", "member": "a value for each member"}),
            "how many values there are",
            default="group",
        ),
        Key(
            "initial",
            NUMBER,
            "where the optimiser begins, in the unit of the parameter",
            otherwise="the law's own, or the defined number",
        ),
        Key("lower", NUMBER, "lower bound, within what the law allows", required=True),
        Key("upper", NUMBER, "upper bound", required=True),
        Key(
            "cost",
            NOT_NEGATIVE,
            "what a unit of each value adds to volume rows that cover the group, or one in which something follows "
            "from the name, as V_i does for a unit of alpha",
            default=0.0,
        ),
    ),
    one_of=(("group", "of"),),
    never_both=(("of", "parameter"), ("of", "law"), ("of", "each")),
    needs=(("group", "parameter"),),
    doc="A parameter of laws or a defined name that the optimiser varies, whether alpha varies or not. Its value takes "
    "the place of the one that the case states.",
)
DESIGN = Record(
    "design settings",
    (
        _design("initial", Number(minimum=0, maximum=1), "start of the design variables, within the bounds", 0.1),
        _design("lower", Number(minimum=0, maximum=1), "lower bound; above 0 where the power is below 1", 0.001),
        _design("upper", Number(minimum=0, maximum=1), "upper bound", 1.0),
        _POWER,
        Key("shared", ListOf(GROUP, what="member groups"), "groups whose members all have one alpha", default=()),
        Key(
            "mirrored",
            ListOf(ListOf(GROUP, 2, "member groups"), what="lists of member groups"),
            "lists of groups with equal counts: member k of each has the same alpha",
            default=(),
        ),
        Key(
            "variables",
            Named(_VARIABLE, "design variable"),
            "parameters of laws and defined names that vary, by name",
        ),
        Key(
            "catalogue",
            ByName(
                "member group",
                ByShape("a list of sizes or {sizes, prices}", sequence=_SIZES, mapping=_CATALOGUE),
                "sizes",
            ),
            "sizes that members have in the end: {group: list of sizes, or sizes and prices}; `run` chooses after the "
            "optimum",
            otherwise="any size between the bounds",
        ),
    ),
    doc="The design variables: alpha, one for each member with `design: true`, parameters of laws, and defined "
    "names. In `initial`, "
    "`lower`, `upper` and `power` groups left out have the default.",
)
_RESPONSE = response_kinds(RESPONSES, IN_SPACE_ALONE, OF_OTHERS)
_OVER_TIME = Key(
    "over_time", explained(reductions()), "how the response over time becomes a number", default=DEFAULT_REDUCTION
)
LOAD_CASE_KEY = Key(
    "load_case",
    Ref("load case", also=("default",)),
    "in which load case",
    otherwise="the only one; needed where there are several",
)
_SENSE = explained({"minimize": "the lower, the better", "maximize": "the higher, the better"})
OBJECTIVE = Record(
    "an objective",
    (
        Key("response", _RESPONSE, "the number of a state that is followed over time", required=True),
        _OVER_TIME,
        LOAD_CASE_KEY,
        Key("sense", _SENSE, "which way is better", default="minimize"),
    ),
    doc="What is to be improved: a response, made a number.",
    elsewhere=tuple((word, NO_RESPONSE) for word in MATERIAL),
)
COMBINE = Record(
    "how objectives are combined",
    (
        Key(
            "method",
            explained(scalarisations()),
            "how the objectives g (Eq. 24 of G) become one U",
            default=DEFAULT_SCALARISATION,
        ),
        Key(
            "weights",
            ByName("objective", NOT_NEGATIVE, "number"),
            "of every objective; not all zero; scaled to the sum 1",
            required=True,
        ),
        Key("exponent", Number(minimum=1), f"p of Eq. 23, for {listed(taking_exponent())}", default=2.0),
        Key("normalize", Flag(), "take g of Eq. 24, between utopia and maximum; false: raw values", default=True),
    ),
    doc="How several objectives become one.",
)
SENSES = ("limit", "fraction", "equals", "at_least")
#: other words for bounds, and which key is meant
_BOUNDS = {
    "at_most": "an upper bound is `limit`",
    "maximum": "an upper bound is `limit`",
    "max": "an upper bound is `limit`",
    "upper": "an upper bound is `limit`",
    "minimum": "a lower bound is `at_least`",
    "min": "a lower bound is `at_least`",
    "lower": "a lower bound is `at_least`",
}
CONSTRAINT = Record(
    "a constraint",
    (
        Key(
            "volume",
            ByShape(
                "all, a member group or a list of member groups",
                scalar=Ref("member group", also=("all",)),
                sequence=ListOf(GROUP, 1, "member groups"),
            ),
            "bounds the sum of alpha_i V_i over these members (Eq. 14)",
        ),
        Key("response", _RESPONSE, "what is bounded over time"),
        Key("over_time", _OVER_TIME.kind, "how the response becomes a number", otherwise=DEFAULT_REDUCTION),
        LOAD_CASE_KEY,
        Key("limit", NUMBER, "at most this"),
        Key("fraction", Number(minimum=0, maximum=1), "of a volume: at most this share of sum V_i"),
        Key("equals", NUMBER, "exactly this"),
        Key("at_least", NUMBER, "at least this"),
    ),
    one_of=(("volume", "response"), SENSES),
    needs=(("over_time", "response"), ("load_case", "response"), ("fraction", "volume")),
    doc="A bound on a volume or on a response. Bounds on a response are in its own unit.",
    elsewhere=tuple(_BOUNDS.items()),
    unit_of=unit_stated,
)


def _option(name: str) -> Key:
    """A single setting of the optimiser; its default is the preset's."""
    option = OPTIONS[name]
    default = str(option.default).lower() if option.type is bool else f"{option.default:g}"
    kind = (
        Flag()
        if option.type is bool
        else Number(option.minimum, None, option.maximum, None, option.type is int)
    )  # fmt: skip
    return Key(name, kind, option.doc, otherwise=f"the preset's; {default} in `default`")


_PRESETS = {
    "default": "the tuned settings of GSAO",
    "oc": "the optimality-criteria update, from the highest peak",
    "mma": "the method of moving asymptotes (Svanberg 1987)",
    "conlin": "reciprocal where a function falls, linear where it rises (Fleury and Braibant 1986)",
    "slp": "sequential linear programming in a trust box",
}
_OPTIMIZERS = OpenWord(tuple(optimizers()), "", tuple(optimizers().values()), optimizers)
OPTIMIZER = Record(
    "optimizer settings",
    (
        Key("name", _OPTIMIZERS, "method", default=DEFAULT_OPTIMIZER),
        Key("preset", explained({name: _PRESETS[name] for name in PRESETS}), "named settings", default="default"),
        Key(
            "max_iterations",
            Number(minimum=0, maximum=10**9, whole=True),
            "evaluations after the first one, for each start",
            default=200,
        ),
        Key(
            "tolerance",
            NOT_NEGATIVE,
            "of the projected KKT residual, relative to the largest |dU/dalpha|",
            default=1e-6,
        ),
        Key(
            "starts",
            Number(minimum=1, maximum=10**6, whole=True),
            "how many starting designs at most; the further ones are random and feasible",
            default=1,
        ),
        Key("seed", Number(minimum=0, maximum=2**53, whole=True), "of the random starts", default=0),
        *(_option(name) for name in OPTIONS),
    ),
    doc="How the design is improved. Single settings override the preset's.",
)
_INTEGRATORS = OpenWord(tuple(integrators()), "", tuple(integrators().values()), integrators)
SOLVER = Record(
    "solver settings",
    (
        Key("integrator", _INTEGRATORS, "how the motion is computed", default="auto"),
        Key(
            "tolerance",
            Number(above=0, below=1),
            "relative error allowed in objectives and their gradients",
            default=1e-8,
        ),
        Key("step", POSITIVE, "fixed step", unit="s", otherwise="chosen from the tolerance"),
        Key(
            "spectral_radius",
            Number(minimum=0, maximum=1),
            "of generalized_alpha: 1 keeps high frequencies, 0 damps them out in a step",
            otherwise="0.8",
        ),
        Key("sensitivity", explained(sensitivities()), "how gradients are computed", default=AUTO_SENSITIVITY),
        Key("assemble", Flag(), "move the start to the nearest one that fits the joints", default=False),
        Key("settle", Flag(), "move the start to the static equilibrium nearby, with each design anew", default=False),
    ),
    doc="How motions and gradients are computed.",
)

FORMAT = Record(
    "a case",
    (
        Key("format", Version(1), "version of the format", required=True),
        Key(
            "dimension",
            OneOf((2, 3)),
            "2: in the plane; 3: in space. It stands above all that depends on it",
            default=2,
        ),
        Key("title", Text(), "what outputs and pictures call the case", default=""),
        Key("extends", FileName(), "path, relative to the case file, of another case, which this one changes"),
        Key("define", Definitions(), "names of numbers, for expressions in this case; a value may be an expression"),
        Key("gravity", PAIR, "acceleration of free fall, [x, y]", default=(0.0, 0.0), unit="m/s^2"),
        Key(
            "time",
            Record(
                "times",
                (
                    Key("start", NUMBER, "when the motion begins", default=0.0, unit="s"),
                    Key("end", NUMBER, "when it ends, after the start", required=True, unit="s"),
                ),
                doc="When the motion is computed.",
            ),
            "when the motion begins and ends",
            required=True,
        ),
        Key(
            "bodies",
            Named(BODY_KEYS, "body", 1),
            "rigid bodies by name; `ground` is there without being declared",
            required=True,
        ),
        Key("joints", ListOf(JOINT, what="joints"), "ideal constraints between two bodies", default=()),
        Key("bushings", ListOf(BUSHING, what="bushings"), "elastic joints", default=()),
        MOTIONS,
        Key("points", Named(POINTS, "point grid"), "grids of points by name"),
        Key("contacts", ListOf(CONTACT, what="contacts"), "points of one body against an edge of another", default=()),
        Key("members", Named(GROUP_KEYS, "member group"), "groups of candidate members by name"),
        LOADS,
        Key(
            "load_cases",
            Named(LOAD_CASE, "load case"),
            "loadings by name, each added to the common part",
            otherwise="one, called `default`",
        ),
        Key("design", DESIGN, "start, bounds and power of the design variables", otherwise="that of each key"),
        Key("objectives", Named(OBJECTIVE, "objective"), "what is to be improved, by name"),
        Key("combine", COMBINE, "how objectives become one; needed where there is more than one"),
        Key("constraints", ListOf(CONSTRAINT, what="constraints"), "bounds on volumes and responses", default=()),
        Key("uncertainty", UNCERTAINTY, "what is not known for certain, and what becomes of objectives then"),
        Key("fit", fit_record(_RESPONSE, LOAD_CASE_KEY), "numbers to estimate from measurements (`mdstopo fit`)"),
        Key("optimizer", OPTIMIZER, "how the design is improved", otherwise="that of each key"),
        Key("solver", SOLVER, "how motions and gradients are computed", otherwise="that of each key"),
    ),
)
