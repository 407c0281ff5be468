"""The arrays that kernels work on as Markdown, from the tables by which they are packed (`mdstopo.compiler.fields`)."""

from mdstopo.compiler.fields import Fields
from mdstopo.general.model.general_model import FIELDS as GENERAL
from mdstopo.general.steps.step_history import FIELDS as HISTORY
from mdstopo.integrators.steps import ARRAYS as STEPS
from mdstopo.scene.packing import FIELDS as SPRINGS

TABLES: dict[str, Fields] = {"springs": SPRINGS, "general": GENERAL, "steps": STEPS, "history": HISTORY}


def table_of(name: str) -> str:
    """One of `TABLES`: name, shape, kind of number, and what an array holds."""
    if name not in TABLES:
        raise ValueError(f"there is no table of arrays {name!r}; there are {', '.join(TABLES)}")
    fields = TABLES[name]
    lines = ["| array | shape | numbers | what |", "| --- | --- | --- | --- |"]
    for field, shape, what in fields.rows():
        numbers = "float" if field in fields.floats else "integer"
        lines.append(f"| `{field}` | {f'({shape})' if shape else ''} | {numbers} | {what} |")
    return "\n".join(lines)
