"""The process that computes scenes: `python -m mdstopo.stress.worker`. A line in names a scene, a line out says how.

It can be ended when a scene hangs; compiled kernels cannot be interrupted from inside.
"""

import json
import os
import sys


def main() -> None:
    """Answer one name after another until the input is closed."""
    output = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever prints by mistake must not disturb the answers
    from mdstopo.stress.judge import judge
    from mdstopo.stress.registry import scenes

    known = scenes()
    for line in sys.stdin:
        found = judge(known[line.strip()])
        answer = found.outcome, found.error, found.message, found.seconds, found.note
        print(json.dumps(answer), file=output, flush=True)


if __name__ == "__main__":
    main()
