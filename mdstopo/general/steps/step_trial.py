"""The step that a run is making: its length, and what has come of it."""

from mdstopo.general.model.bundles import bundle


class Trial:
    """The step that is being made, inside kernels; its numbers change.

    h (s): its length. lands: whether it ends at the end of its segment. stages: how many are kept. happens, who:
    whether it ends where a member switches, and who has the smallest margin, -1: nobody.
    """

    def __init__(self, *_numbers: object) -> None: ...


bundle(Trial, ("h", "lands", "stages", "happens", "who"))
