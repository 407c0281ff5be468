"""What the process of the stress test does where no scene is computed: a module of its own, so that it does not import
pytest."""

import os
import time
from collections.abc import Callable


def open_fakes(_: object) -> Callable[[str, object], tuple[str, float, str, float, str]]:
    """In the other process: what computes no scene but ends, or takes long, where the name says so."""

    def perform(name: str, _parent: object) -> tuple[str, float, str, float, str]:
        if name == "ends":
            os._exit(3)
        time.sleep(60 if name == "hangs" else 0)
        return "right", 0.0, "", 0.0, ""

    return perform
