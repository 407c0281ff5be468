"""What `general.observed` names of a scene is there."""

from mdstopo.general.general_model import GeneralModel
from mdstopo.general.observed import BALANCE


def test_arrays_that_a_number_may_change_are_fields_of_a_scene() -> None:
    assert set(GeneralModel._fields) >= BALANCE
