"""The commands there are. A new one is a line here and a file of its name beside this one."""

COMMANDS: dict[str, str] = {
    "run": "Optimise a case and keep its result file up to date.",
    "pareto": "Trace the front of several objectives.",
    "sweep": "Run a case over weights, or over values of any keys.",
    "check": "Read a case and say what is in it, without running it.",
    "fit": "Estimate numbers of a case from measurements.",
    "bound": "Bound peaks of acceleration and travel over all members that could be.",
    "simulate": "Compute the motion of one design.",
    "gradient": "Compare sensitivity methods on one design.",
    "finalize": "Keep the members of a result that count, size them anew, write their case.",
    "show": "Say in words what a result file holds.",
    "plot": "Draw what a result file holds.",
    "report": "Write one HTML page that shows a result in motion.",
    "animate": "Write the motion of a result as GIF, MP4 or SVG.",
    "watch": "Follow a run, front, sweep or fit on a page of this computer.",
    "diff": "Say what differs between two results.",
    "export": "Write a result as CSV tables or JSON.",
    "bench": "Measure scaling, work against precision, and what is left out.",
    "lift": "Write the case in space of a planar one.",
    "new": "Write a starter case, with comments; --list shows the templates.",
    "import": "Read points from CSV, DXF or SVG, bodies and joints from URDF or MJCF.",
    "schema": "Print the JSON Schema of the case format, for editors.",
    "stress": "Compute extreme scenes and compare each with an independent value.",
    "completion": "Print what makes a shell complete commands, options and files.",
}

EXIT_STATUSES: dict[int, str] = {0: "done", 1: "failed", 2: "bad input", 3: "interrupted"}

_INTRODUCTION = """\
Usage: mdstopo COMMAND [OPTIONS] ...

  Topology optimisation of the members that tie multibody systems together.

Commands:
{commands}

Options:
  --version   Show the version.
  -h, --help  Show this, or a command's options: mdstopo run --help

Exit status: {statuses}."""


def help_text() -> str:
    """What `mdstopo --help` prints."""
    width = max(len(name) for name in COMMANDS)
    lines = [f"  {name:{width}}  {sentence}" for name, sentence in COMMANDS.items()]
    statuses = ", ".join(f"{number} {meaning}" for number, meaning in EXIT_STATUSES.items())
    return _INTRODUCTION.format(commands="\n".join(lines), statuses=statuses)
