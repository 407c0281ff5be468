"""How mistakes are worded: values shown safely on one line, lists of words, the nearest right word."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

#: the fixed body
GROUND = "ground"
#: what is told of a number with a decimal comma
DECIMAL_SIGN = "the decimal sign is a point"

_LONGEST = 60
_MOST = 60
_MOST_COMPARED = 2000


def shown(text: str) -> str:
    """`text` quoted, on one line, cut where it is long."""
    cut = text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."
    return repr(cut)


def inside(path: str, key: str) -> str:
    """The path of `key` in the mapping at `path`; a key that is no name is shown quoted."""
    name = key if key.replace("-", "_").isidentifier() else shown(key)
    return f"{path}.{name}" if path else name


def listed(words: Iterable[str]) -> str:
    """``a, b, c``, on one line; cut where there are very many."""
    all_words = list(words)
    told = [word if word.isprintable() and len(word) <= _LONGEST else shown(word) for word in all_words[:_MOST]]
    return ", ".join(told) + (f", ... ({len(all_words)} in all)" if len(all_words) > _MOST else "")


def count_text(count: int) -> str:
    """A count with separators, or its order of magnitude where it has too many digits to be read."""
    if count < 10**15:
        return f"{count:,}"
    return f"about 10^{int((count.bit_length() - 1) * 0.30103)}"


def number_text(value: float) -> str:
    """A number as text of at most ten digits."""
    return f"{value:.10g}"


def nearest(word: str, words: Iterable[str]) -> str | None:
    """The one of `words` most like a word, whatever the case of its letters; None where none is like it."""
    from difflib import get_close_matches

    by_lower = {candidate.lower(): candidate for candidate in islice(words, _MOST_COMPARED)}
    found = get_close_matches(word[:_LONGEST].lower(), list(by_lower), n=1, cutoff=0.6)
    return by_lower[found[0]] if found else None


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """A hint for a mistyped word: ``, did you mean 'x'?``; empty where no word is like it."""
    best = nearest(word, words)
    return f", did you mean {best!r}?" if best is not None else ""
