"""The member laws that a case file may name: what is declared of each, one file a law.

What a law does stands in `mdstopo.mechanics.laws`, in the module that its record names.
"""

from mdstopo.case.laws.actuator import ActuatorLaw
from mdstopo.case.laws.crush import CrushLaw
from mdstopo.case.laws.cubic import CubicLaw
from mdstopo.case.laws.curve import CurveLaw
from mdstopo.case.laws.gap import GapLaw
from mdstopo.case.laws.inerter import InerterLaw
from mdstopo.case.laws.law import Law
from mdstopo.case.laws.pulse import PulseLaw
from mdstopo.case.laws.spring import SpringLaw
from mdstopo.case.laws.table import TableLaw

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
    )
}

__all__ = [
    "LAWS",
    "ActuatorLaw",
    "CrushLaw",
    "CubicLaw",
    "CurveLaw",
    "GapLaw",
    "InerterLaw",
    "Law",
    "PulseLaw",
    "SpringLaw",
    "TableLaw",
]
