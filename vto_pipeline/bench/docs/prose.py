"""Prose checks: sentence length, README length, and no measured figure typed by hand."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

LONGEST = 25
"""Words in a sentence."""
README_WORDS = 900

_FENCE = re.compile(r"^(```|~~~).*?^\1\s*$", re.M | re.S)
_COMMENT = re.compile(r"<!--.*?-->", re.S)
_CODE = re.compile(r"`[^`\n]+`")
_IMAGE, _LINK = re.compile(r"!\[[^\]]*\]\([^)]*\)"), re.compile(r"\[([^\]]*)\]\([^)]*\)")
_BLOCK_START = re.compile(r"^\s*(?:[-*+]|\d+\.)\s+|^>\s?")
_SKIPPED = ("|", "#", "---", "===")
_SENTENCE_END = re.compile(r"(?<=[.!?])[\"')\]*_]*\s+(?=[\"'(\[*_]*[A-Z0-9`])")
_ABBREVIATION = re.compile(r"\b(e\.g|i\.e|vs|cf|approx|Fig|No|et al)\.", re.I)
_WORD = re.compile(r"[^\W_]")

_TEMPLATE = re.compile(r"\{\{.*?\}\}|\{%.*?%\}|\{#.*?#\}", re.S)
_UNITS = (
    r"nm|mm|cm|km|m|ms|s|min|h|kg|g|N|Pa|GB|MB|kB|Hz|W|dB|px|pixels?|fps|points?|percent|times|seconds?|minutes?|hours?|%|"
    r"°|degrees?|frames?|vertices|triangles|million"
)
_NUMBER = r"(?<![\w.^/-])\d(?:[\d.,]*\d)?"
_FIGURE = re.compile(
    rf"{_NUMBER}(?:e-?\d+)?\s?(?:{_UNITS})(?![\w/²³])"
    rf"|{_NUMBER}e-?\d+\b"
    rf"|{_NUMBER} of (?:the )?\d[\d,]*"
    rf"|{_NUMBER} (?:[a-z]+ ){{0,3}}an? (?:second|minute|hour|frame|row|step)\b"
    r"|(?<![\w.^/-])\d+\.\d+(?![\w.])"
)
"""A number with a unit or an exponent, a share of a count, a rate, or a number with decimals."""
_CELL = re.compile(r"(?<=\|)\s*\**[±–-]?[\d.,]*\d(?:(?: to |, |/| ± )\d[\d.,]*)*\**\s*(?=\|)")
"""A cell of a table that holds bare numbers."""


@dataclass(frozen=True)
class Fault:
    """What is wrong in a text.

    Args:
        line: Where, counted from 1.
        problem: What, in words.
    """

    line: int
    problem: str


def long_sentences(text: str, longest: int = LONGEST) -> list[Fault]:
    """Return the sentences of a Markdown text with more words than allowed; tables, headings and code do not count."""
    found = []
    for line, paragraph in _paragraphs(text):
        for sentence in _SENTENCE_END.split(_ABBREVIATION.sub(lambda hit: hit[0].replace(".", ""), paragraph)):
            words = count_words(sentence)
            if words > longest:
                found.append(Fault(line, f"{words} words, at most {longest}: {sentence.strip()[:90]} ..."))
    return found


def count_words(text: str) -> int:
    """Return how many words there are: what holds a letter or digit between spaces."""
    return sum(bool(_WORD.search(part)) for part in text.split())


def typed_figures(template: str) -> list[Fault]:
    """Return the figures in a page's source that no results file stands behind: `figures_in`, and what templates hide.

    What was chosen rather than measured, such as a setting or a size, is written `chosen("2 s")` in a template. Numbers
    that the template itself holds and shows count too, with a unit or without.
    """
    found = [Fault(line, f"typed by hand: {value}") for line, value in _shown_constants(template)]
    return found + figures_in(_TEMPLATE.sub(_emptied, template))


def figures_in(text: str) -> list[Fault]:
    """Return what looks like a measured figure in a Markdown text: with a unit, an exponent, decimals, or in a table.

    Code does not count, but for the remarks in it; neither does the first column of a table, which says what a row is.
    Numbers in words are not found.
    """
    text = _FENCE.sub(_remarks, text)
    for blank in (_COMMENT, _CODE, _IMAGE):
        text = blank.sub(_emptied, text)
    found = []
    for number, line in enumerate(_LINK.sub(r"\1", text).splitlines(), start=1):
        hits = [hit[0] for hit in _FIGURE.finditer(line)]
        if line.startswith("|"):
            named = line.index("|", 1) if line.count("|") > 1 else 0
            bare = (hit[0].strip() for hit in _CELL.finditer(line, named))
            hits += [cell for cell in bare if not _FIGURE.search(cell)]
        found += [Fault(number, f"typed by hand: {hit}") for hit in hits]
    return found


def _shown_constants(template: str) -> Iterator[tuple[int, Any]]:
    """Yield line and value of what is shown, or kept to be shown, and stands in the template: not what asks for it."""
    from jinja2 import Environment, nodes

    tree = Environment().parse(template)
    roots: list[nodes.Node] = [one.node for one in tree.find_all(nodes.Assign)]
    for root in [*roots, *(node for shown in tree.find_all(nodes.Output) for node in shown.nodes)]:
        waiting = [root]
        while waiting:
            node = waiting.pop()
            if isinstance(node, nodes.Const) and re.search(r"\d", str(node.value)):
                yield node.lineno, node.value
            if not isinstance(node, nodes.Call | nodes.Getitem):
                waiting += node.iter_child_nodes()


def _paragraphs(text: str) -> Iterator[tuple[int, str]]:
    """Yield the line on which each paragraph or list item begins, and its words."""
    for blank in (_FENCE, _COMMENT):
        text = blank.sub(_emptied, text)
    text = _CODE.sub("Code", text)
    text = _LINK.sub(r"\1", _IMAGE.sub("", text))
    begun, kept = 1, list[str]()
    for number, line in enumerate([*text.splitlines(), ""], start=1):
        starts = _BLOCK_START.match(line)
        ends = not line.strip() or line.lstrip().startswith(_SKIPPED)
        if (ends or starts) and kept:
            yield begun, " ".join(kept)
            kept = []
        if ends:
            continue
        if not kept:
            begun = number
        kept.append(line[starts.end() :] if starts else line.strip())


def _remarks(block: re.Match[str]) -> str:
    """Return as many lines, with what stands behind a # only: commands hold numbers, remarks may hold figures."""
    return "\n".join(line.partition("#")[2] for line in block[0].split("\n"))


def _emptied(hit: re.Match[str]) -> str:
    """Return as many lines, empty."""
    return "\n" * hit[0].count("\n")
