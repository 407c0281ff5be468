"""What --set changed of a case, as settings of its result file: `set KEY`, with the value in YAML."""

from collections.abc import Mapping

from mdstopo.case.model import Case
from mdstopo.store.image import Attribute

_SET = "set "


def set_keys(case: Case) -> dict[str, Attribute]:
    """The settings of a file that say what --set changed of its case."""
    return {f"{_SET}{key}": str(value) for key, value in case.overrides.items()}


def read_set_keys(settings: Mapping[str, Attribute]) -> dict[str, str]:
    """What --set changed, key path -> value in YAML, from the settings of a file."""
    return {key.removeprefix(_SET): str(value) for key, value in settings.items() if key.startswith(_SET)}


def without_set_keys(settings: Mapping[str, Attribute]) -> dict[str, Attribute]:
    """The settings of a file that are not what --set changed."""
    return {key: value for key, value in settings.items() if not key.startswith(_SET)}
