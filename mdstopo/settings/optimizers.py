"""The optimisers that a case file may name: what is declared of each, one record an optimiser.

What a record names has the interface of `optimizer.interface`. Imports nothing heavy: the reader uses it too.
"""

from typing import NamedTuple

from mdstopo.settings.optimizer_options import OPTIONS
from mdstopo.settings.optimizer_presets import DEFAULT_OPTIMIZER, PRESETS


class OptimizerKind(NamedTuple):
    """What is declared of an optimiser: its name, where its code is, and what it can do.

    name: as case files have it; doc: a sentence for the case reference. made_by: module:class, called with the problem
    and `Settings`; states: module:class of its states, derived from `optimizer.state.State`. options, presets: names of
    the single settings and of the named ones that it takes; `max_iterations` and `tolerance` all do. takes_limits:
    whether it keeps limits on responses; takes_volumes: on linear rows.
    """

    name: str
    doc: str
    made_by: str
    states: str
    options: frozenset[str] = frozenset()
    presets: frozenset[str] = frozenset({"default"})
    takes_limits: bool = False
    takes_volumes: bool = False


#: the optimisers by their name
OPTIMIZERS: dict[str, OptimizerKind] = {
    kind.name: kind
    for kind in (
        OptimizerKind(
            DEFAULT_OPTIMIZER,
            "generalized sequential approximate optimization",
            "mdstopo.optimizer.gsao:Gsao",
            "mdstopo.optimizer.gsao_state:GsaoState",
            frozenset(OPTIONS),
            frozenset(PRESETS),
            takes_limits=True,
            takes_volumes=True,
        ),
    )
}


def names(_: bool = False) -> dict[str, str]:
    """The optimisers by their names, with what they are."""
    return {kind.name: kind.doc for kind in OPTIMIZERS.values()}
