"""Formulas as MathML, made when the pages are built, so that a browser fetches nothing to show them.

latex2mathml does the translation. Browsers follow MathML Core, which knows no letters made bold by an attribute, sets
single letters in italics, aligns columns by style and takes limits for what `munder` says: that is put right here.
"""

import html
import re
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from latex2mathml.converter import convert

_FORMULA = re.compile(r'<(span|div) class="arithmatex">(.*?)</\1>', re.DOTALL)
_BRACKETS = re.compile(r"\\[(\[](.*)\\[)\]]", re.DOTALL)
_UPRIGHT = re.compile(r"<mi>&#x0*([46][1-9A-F]|[57][0-9A]);</mi>")
_NAMESPACE = ' xmlns="http://www.w3.org/1998/Math/MathML"'
#: accents, each as the character that fonts draw as one
_ACCENTS = {"\u02d9": "\u02d9", "\u00a8": "\u00a8", "\u00af": "\u00af", "^": "\u02c6", "~": "\u02dc"}
_LIMITS = {"\u2211", "\u220f", "max", "min", "sup", "inf"}
_UNDER = {"msub": "munder", "msubsup": "munderover", "msup": "mover"}
#: how many parts these have
_PARTS = {"mfrac": 2, "mroot": 2, "msub": 2, "msup": 2, "munder": 2, "mover": 2, "msubsup": 3, "munderover": 3}
#: environments that the translation knows by another name only
_ENVIRONMENTS = {"aligned": "align*", "split": "align*", "gathered": "gather*"}
#: the first bold letter of each alphabet in Unicode: capitals and small letters, upright and italic
_BOLD_LETTERS = {
    "bold": {"A": 0x1D400, "a": 0x1D41A, "Α": 0x1D6A8, "α": 0x1D6C2, "0": 0x1D7CE},
    "bold-italic": {"A": 0x1D468, "a": 0x1D482, "Α": 0x1D71C, "α": 0x1D736, "0": 0x1D7CE},
}
_COUNTS = {"A": 26, "a": 26, "Α": 25, "α": 25, "0": 10}


class FormulaError(ValueError):
    """A formula that cannot be shown."""


def with_mathml(page: str) -> str:
    """The HTML of a page with every formula that arithmatex has marked as MathML. Raises FormulaError."""
    return _FORMULA.sub(lambda found: _translated(found[1] == "div", found[2]), page)


def mathml(formula: str, block: bool = False) -> str:
    """A formula in LaTeX as a `math` element. Raises FormulaError where a part of it cannot be translated."""
    known = formula
    for name, other in _ENVIRONMENTS.items():
        known = known.replace(f"{{{name}}}", f"{{{other}}}")
    try:
        markup = convert(known, display="block" if block else "inline").replace(_NAMESPACE, "")
        # Letters that were written upright come as numbers, and only they do.
        root = ElementTree.fromstring(_UPRIGHT.sub(r'<mi mathvariant="normal">&#x\1;</mi>', markup))
    except Exception as error:
        raise FormulaError(f"cannot be translated: {formula!r} ({type(error).__name__}: {error})") from error
    for node in root.iter():
        empty = node.tag == "mo" and not node.text and not node.attrib
        if "\\" in (node.text or "") or empty or len(node) != _PARTS.get(node.tag, len(node)):
            raise FormulaError(f"a part of it is not known: {formula!r}")
        _put_right(node)
    return ElementTree.tostring(root, encoding="unicode")


def font() -> Path:
    """STIX Two Math (SIL Open Font License), from the package that carries it: few systems have a font for formulas."""
    package = find_spec("ziamath")
    if package is None or package.origin is None:
        raise FormulaError("the font of formulas comes with ziamath, which is not installed")
    return Path(package.origin).parent / "fonts" / "STIXTwoMath-Regular.ttf"


def _translated(block: bool, text: str) -> str:
    found = _BRACKETS.fullmatch(html.unescape(text).strip())
    if found is None:
        raise FormulaError(f"no formula: {text!r}")
    markup = mathml(found[1].strip(), block)
    return f'<div class="formula">{markup}</div>' if block else markup


def _put_right(node: Element) -> None:
    """What the translation leaves to attributes and browsers do not know."""
    text = node.text or ""
    if node.tag == "mi" and node.get("mathvariant") in _BOLD_LETTERS:
        alphabets = _BOLD_LETTERS[node.attrib.pop("mathvariant")]
        node.text = "".join(_bold(letter, alphabets) for letter in text)
    elif node.tag == "mi" and "Α" <= text <= "Ω":
        node.set("mathvariant", "normal")
    elif node.tag == "mover" and (node[1].text or "") in _ACCENTS:
        node.set("accent", "true")
        node[1].text = _ACCENTS[node[1].text or ""]
        node[1].set("stretchy", "false")
    elif node.tag == "mtd" and "columnalign" in node.attrib:
        side = node.attrib.pop("columnalign")
        # what is aligned with what follows or precedes it stands close to it
        close = {"right": "; padding-right: 0", "left": "; padding-left: 0"}.get(side, "")
        node.set("style", f"text-align: {side}{close}")
    elif node.tag in _UNDER and len(node) and (node[0].text or "") in _LIMITS:
        node.tag = _UNDER[node.tag]
        node[0].set("movablelimits", "true")


def _bold(letter: str, alphabets: dict[str, int]) -> str:
    for first, place in alphabets.items():
        if 0 <= ord(letter) - ord(first) < _COUNTS[first]:
            return chr(place + ord(letter) - ord(first))
    return letter
