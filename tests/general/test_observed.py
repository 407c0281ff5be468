"""What `general.driver.observed` names of a scene is there."""

from mdstopo.general.driver.observed import BALANCE
from mdstopo.general.model.general_model import GeneralModel


def test_arrays_that_a_number_may_change_are_fields_of_a_scene() -> None:
    assert set(GeneralModel._fields) >= BALANCE
