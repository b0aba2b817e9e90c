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
_UNITS = r"nm|mm|cm|km|m|ms|s|min|h|kg|g|N|Pa|GB|MB|kB|Hz|W|points?|percent|times|seconds?|minutes?|hours?|%"
_FIGURE = re.compile(rf"(?<![\w.^/-])\d[\d.,]*(?:e-?\d+)?\s?(?:{_UNITS})(?![\w/²³])|(?<![\w.^/-])\d[\d.]*e-?\d+\b")


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
    """Return the figures with a unit, or with an exponent, in a page's source that no results file stands behind.

    What was chosen rather than measured, such as a setting or a size, is written `chosen("2 s")` in a template. Numbers
    that the template itself holds and shows count too, with a unit or without.
    """
    found = [Fault(line, f"typed by hand: {value}") for line, value in _shown_constants(template)]
    template = _FENCE.sub(_remarks, template)
    for blank in (_COMMENT, _TEMPLATE, _CODE):
        template = blank.sub(_emptied, template)
    for number, line in enumerate(template.splitlines(), start=1):
        found += [Fault(number, f"typed by hand: {hit[0]}") for hit in _FIGURE.finditer(line)]
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
