"""The member laws that a case file may name: what is declared of each, one file a law.

What a law does stands in `mdstopo.mechanics.laws`, in the module that its record names.
"""

from typing import Any

from mdstopo.case.keys.records import Record
from mdstopo.case.laws.actuator_law import ActuatorLaw
from mdstopo.case.laws.crush_law import CrushLaw
from mdstopo.case.laws.cubic_law import CubicLaw
from mdstopo.case.laws.curve_law import CurveLaw
from mdstopo.case.laws.expression_law import ExpressionLaw
from mdstopo.case.laws.gap_law import GapLaw
from mdstopo.case.laws.inerter_law import InerterLaw
from mdstopo.case.laws.law import Law, record_of
from mdstopo.case.laws.pulse_law import PulseLaw
from mdstopo.case.laws.spring_law import SpringLaw
from mdstopo.case.laws.table_law import TableLaw

#: the laws by their word; their codes in kernels follow this order
LAWS: dict[str, type[Law]] = {
    law.type: law
    for law in (
        SpringLaw,
        GapLaw,
        CubicLaw,
        CurveLaw,
        PulseLaw,
        TableLaw,
        ActuatorLaw,
        CrushLaw,
        InerterLaw,
        ExpressionLaw,
    )
}


def enter_law(law: Any) -> Record:
    """Add the law of another distribution to the known ones; TypeError where it is no law, or its word is taken."""
    if not (isinstance(law, type) and issubclass(law, Law)):
        raise TypeError(f"found {law!r}, needed is a subclass of Law")
    if LAWS.setdefault(law.type, law) is not law:
        raise TypeError(f"there is a law {law.type!r} already")
    return record_of(law)


__all__ = [
    "LAWS",
    "ActuatorLaw",
    "CrushLaw",
    "CubicLaw",
    "CurveLaw",
    "ExpressionLaw",
    "GapLaw",
    "InerterLaw",
    "Law",
    "PulseLaw",
    "SpringLaw",
    "TableLaw",
    "enter_law",
]
