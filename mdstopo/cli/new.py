"""`mdstopo new`: a case to start from."""

from pathlib import Path

import click

from mdstopo.cli.options import FILE
from mdstopo.cli.output import Output

STARTER = """\
# yaml-language-server: $schema=case.schema.json
# (`mdstopo schema --out case.schema.json` makes that file; editors then complete and check as you type)
format: 1
title: {title}

# SI units: m, kg, s, N, rad. All coordinates are global, at the start: draw the scene once.
gravity: [0, -9.81]
time: {{end: 0.8}}

bodies:                         # `ground` is there without being declared
  cargo: {{mass: 800, inertia: 120, position: [0, 0.9]}}
  deck: {{mass: 12000, inertia: 40000, position: [0, 0]}}

# What the deck does is given, so it has no unknowns: braking, as a table of [time, acceleration].
motions:
  - body: deck
    x: {{acceleration: {{table: [[0, 0], [0.1, -6], [0.35, -6], [0.45, 0]]}}}}
    y: {{velocity: 0}}
    angle: {{velocity: 0}}

points:                         # where members may be fixed
  cargo_sides: {{body: cargo, grid: {{rectangle: {{center: [0, 0.9], size: [1.2, 0.8], count: 12}}}}}}
  deck_rail: {{body: deck, grid: {{line: {{from: [-2, 0.3], to: [2, 0.3], count: 17}}}}}}
  cargo_feet: {{body: cargo, grid: {{list: [[-0.5, 0.5], [0.5, 0.5]]}}}}
  deck_feet: {{body: deck, grid: {{list: [[-0.5, 0.3], [0.5, 0.3]]}}}}

members:                        # every point of the one with every point of the other: 12 x 17 candidates
  straps:
    from: cargo_sides
    to: deck_rail
    max_length: 1.8             # longer ones are no candidates
    law: {{type: spring, stiffness: 4000, damping: 40}}
  feet:                         # not designed: two stiff supports under the cargo
    from: cargo_feet
    to: deck_feet
    connect: pairs
    law: {{type: spring, stiffness: 4.0e+5, damping: 6000}}
    design: false

# alpha scales each strap: 0.001 is as good as none, 1 is a whole one.
design: {{initial: 0.1, lower: 0.001, upper: 1}}

objectives:
  slide: {{response: {{displacement: {{body: cargo, relative_to: deck, component: x}}}}, over_time: max_abs}}
  blow: {{response: {{acceleration: {{body: cargo, component: x}}}}, over_time: max_abs}}
combine: {{weights: {{slide: 0.5, blow: 0.5}}}}   # `mdstopo run` takes these; `mdstopo pareto` traces all

constraints:
  - {{volume: straps, fraction: 0.2}}            # a fifth of all candidates may be used

# optimizer: {{starts: 4}}                       # more starts, for problems with many local optima
# solver: {{tolerance: 1e-8}}                    # relative error of the objectives and their gradients
"""


@click.command("new")
@click.argument("name", metavar="NAME")
@click.option("--out", type=FILE, metavar="FILE", help="Where to (default: NAME.yaml).")
@click.option("--quiet", "-q", is_flag=True, help="Say nothing but mistakes.")
def command(name: str, out: Path | None, quiet: bool) -> int:
    """Write a commented case to start from: cargo strapped to a deck that brakes."""
    place = out or Path(name if name.endswith((".yaml", ".yml")) else f"{name}.yaml")
    title = Path(name).stem.replace("_", " ").replace("-", " ") or "case"
    import json

    from mdstopo.store.store_errors import StoreError

    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("x", encoding="utf-8") as file:
            file.write(STARTER.format(title=json.dumps(title)))
    except FileExistsError as error:
        raise StoreError(f"{place} exists already; it is left as it is") from error
    except OSError as error:
        raise StoreError(f"{place}: cannot be written: {error.strerror}") from error
    output = Output(json=False, quiet=quiet)
    output.say(f"{place}\n  mdstopo check {place}\n  mdstopo run {place}\n  mdstopo pareto {place}")
    return 0
