"""A file of the package is found by its name alone."""

from collections import Counter
from pathlib import Path

import mdstopo


def test_no_file_name_occurs_twice():
    root = Path(mdstopo.__file__).parent
    names = Counter(path.name for path in root.rglob("*.py") if path.name != "__init__.py")
    assert len(names) > 500
    assert [name for name, count in names.items() if count > 1] == []
