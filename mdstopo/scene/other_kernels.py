"""Kernels of other distributions that a case needs: the store of machine code has to know them before it loads any."""

import importlib

from mdstopo.case.model import Case, VolumeRow
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.compiler import store


def include_kernels(case: Case) -> None:
    """Have machine code kept apart, by their sources too, where laws or responses of a case come from elsewhere."""
    named = [law.kernels for group in case.members for law in group.laws]
    responses = [each.response for each in (*case.objectives, *case.constraints) if not isinstance(each, VolumeRow)]
    named += [kind_of(each).kernels.partition(":")[0] for response in responses for each in response.parts]
    for module in named:
        if not module.startswith("mdstopo."):
            importlib.import_module(module)
            store.include(module)
