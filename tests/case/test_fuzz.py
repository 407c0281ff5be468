"""Whatever stands in a file, the reader gives a case or located mistakes, never another exception."""

from __future__ import annotations

import random
import re

import pytest

from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.scene.refusals import refusals

from .scenes import EVERYTHING, SMALL

WORDS = """1e308 -1e308 1e-320 1e150 1e154 1e200 1e-170 0 -1 .nan .inf 1e999 "1" null ~ [] {} [1,2] true
on ground all default a b {table:[[0,1]]} {table:[]} [[0,1],[0,2],[0,3]] {file:nofile.csv} {file:/} {file:3}
99999999999999999999 0x1F 1_000 hip energy {energy:1} *b !!int << "\\0" [*b] {<<:*b} [1e308,1e308] [1e200,0]
length 0.5 {belts:1} {a:[0,0]} "a\\nb" 5.5 10000000 [100000,100000] spring {type:spring}
[[0,1e308],[1e-300,-1e308]]"""
NASTY = [
    "1e308",
    "-1e308",
    "1e-320",
    "1e150",
    "1e154",
    "1e200",
    "1e-170",
    "0",
    "-1",
    ".nan",
    ".inf",
    "1e999",
    '"1"',
    "null",
    "~",
    "[]",
    "{}",
    "[1,2]",
    "true",
    "on",
    "ground",
    "all",
    "default",
    "a",
    "b",
    "{table:[[0,1]]}",
    "{table:[]}",
    "[[0,1],[0,2],[0,3]]",
    "{file:nofile.csv}",
    "{file:/}",
    "{file:3}",
    "99999999999999999999",
    "0x1F",
    "1_000",
    "hip",
    "energy",
    "{energy:1}",
    "*b",
    "!!int",
    "<<",
    '"\\0"',
    "[*b]",
    "{<<:*b}",
    "[1e308,1e308]",
    "[1e200,0]",
    "length",
    "0.5",
    "{belts:1}",
    "{a:[0,0]}",
    '"a\\nb"',
    "5.5",
    "10000000",
    "[100000,100000]",
    "spring",
    "{type:spring}",
    "[[0,1e308],[1e-300,-1e308]]",
]
NASTY = [re.sub(r"(?<=\w):", ": ", word) for word in WORDS.split()]
CHARACTERS = "\t\0\x85\u2028{}[]:,-#\"'&*%@`|>\ufeffé\U0001f600\ud800"
VALUE = re.compile(r"(?<=: )[^,\[\]{}\n]+|(?<=[\[, ])-?[0-9][0-9.e]*|\[[^\[\]]*\]|\{[^{}]*\}|(?<=[{ ])\w+(?=:)")
LOCATED = re.compile(r"x\.yaml:[1-9][0-9]*:[1-9][0-9]*: .+")


def mutated(text: str, rng: random.Random) -> str:
    kind = rng.random()
    if kind < 0.75:
        matches = list(VALUE.finditer(text))
        if matches:
            match = rng.choice(matches)
            return text[: match.start()] + rng.choice(NASTY) + text[match.end() :]
    lines = text.split("\n")
    at = rng.randrange(len(lines))
    if kind < 0.85:
        lines[at : at + rng.randrange(2)] = [rng.choice(lines)] * rng.randrange(2)
        return "\n".join(lines)
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(CHARACTERS) + text[at:] if kind < 0.97 else text[:at]


@pytest.mark.parametrize("seed", range(4))
def test_mutated_cases_are_read_or_refused_by_place(seed: int) -> None:
    rng = random.Random(seed)
    refused = 0
    wrong: list[str] = []
    for _ in range(150):
        text = rng.choice([SMALL, EVERYTHING])
        for _ in range(rng.choice([1, 1, 2, 3])):
            text = mutated(text, rng)
        try:
            refusals(read_case(text, path="x.yaml"))
        except CaseError as error:
            refused += 1
            wrong += [line for line in str(error).split("\n") if not LOCATED.fullmatch(line)]
    assert wrong == []
    assert refused > 100
