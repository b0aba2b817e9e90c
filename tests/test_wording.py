"""What users read is plain English: short sentences, and none of the phrases that a native engineer would not write."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import vto_pipeline
from vto_pipeline.bench.docs.prose import long_sentences

PACKAGE = Path(vto_pipeline.__file__).parent

ODD = {
    r"\b(is|are|was) told\b|\btold of\b": "say who reports what",
    r"\bfound out\b": "is detected, is determined",
    r"\bcalled so\b": "give the name",
    r"\bof who\b": "of a person who",
    r"\b(some|no)body('s| else)?\b": "say what it is; use the passive if need be",
    r"\bmend(s|ed|ing)?\b(?!:)": "fix, repair",
    r"\bcrumbs?\b": "fragment, small piece",
    r"\blonel(y|ier)\b": "isolated",
    r"\bone over the other\b": "in layers",
    r"\bhangs? together\b": "is connected",
    r"\bturned over\b": "flipped",
    r"\bwhat the garment was on\b": "the source body",
}
"""Pattern -> what to write instead, in messages and docstrings."""

ODD_IN_MESSAGES = ODD | {
    r"\bis no (?!longer)": "is not a",
    r"^wanted\b|[;,] wanted\b": "expected",
    r"\bgo(es)? on\b": "continue, resume",
    r"\bfor people\b": "say what it is for",
}

_SPEAKING = {"warn", "note", "leave_out", "progress", "Bench", "ArtifactKind", "_leaf", "_json"}
"""Calls whose arguments users read; those of errors they do, too."""
_NAMED = {"problem", "hint", "help", "description", "about"}


def test_the_collector_sees_every_kind_of_text() -> None:
    source = '''
@click.option("--a", help="one")
def a_command():
    """Two."""
    raise InputError(f"three {x:.1f}", hint="four" if x else "five")
size: int = Field(1, description="six " "seven")
problem = f"eight {y}" + "nine"
job.warn("ten")
job.leave_out("eleven", "twelve")
Stage("not a text", about="thirteen")
COMMANDS = {"run": "Fourteen."}
'''
    texts = ["one", "Two.", "three 0", "four", "five", "six seven", "eight 0", "nine", "ten", "eleven", "twelve"]
    assert sorted(text for _, text in user_texts(source)) == sorted([*texts, "thirteen", "Fourteen."])


def test_users_read_plain_english() -> None:
    root = PACKAGE.parent
    pages = [root / "README.md", root / "CHANGELOG.md", *sorted((root / "docs").rglob("*.md"))]
    texts = [(page, 1, page.read_text(encoding="utf-8")) for page in pages]
    for path in sorted(PACKAGE.rglob("*.py")):
        texts += [(path, line, text) for line, text in user_texts(path.read_text(encoding="utf-8"))]
    faults = odd_phrases(texts, ODD_IN_MESSAGES)
    faults += [f"{path}:{line}: {fault.problem}" for path, line, text in texts for fault in long_sentences(text)]
    assert not faults, "\n".join(faults)


def test_docstrings_are_free_of_odd_phrases() -> None:
    texts = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                texts.append((path, getattr(node, "lineno", 1), ast.get_docstring(node) or ""))
    faults = odd_phrases(texts, ODD)
    assert not faults, "\n".join(faults)


def odd_phrases(texts: Iterable[tuple[Path, int, str]], odd: Mapping[str, str]) -> list[str]:
    """Return where a text holds an odd phrase, and what to write instead."""
    return [
        f"{path}:{line}: {hit[0]!r} in {text[:90]!r}: {instead}"
        for path, line, text in texts
        for pattern, instead in odd.items()
        for hit in re.finditer(pattern, text, re.I)
    ]


def user_texts(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and text of messages, help and descriptions; each value in an f-string counts as one word."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name.endswith("Error") or name in _SPEAKING:
                yield from _texts(*node.args)
            yield from _texts(*(keyword.value for keyword in node.keywords if keyword.arg in _NAMED))
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            if node.targets[0].id in _NAMED or node.targets[0].id == "COMMANDS":
                yield from _texts(node.value)
        elif isinstance(node, ast.FunctionDef) and node.name.endswith("_command"):
            yield node.lineno, (ast.get_docstring(node) or "").partition("\b")[0]


def _texts(*values: ast.expr) -> Iterator[tuple[int, str]]:
    for value in values:
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            yield value.lineno, value.value
        elif isinstance(value, ast.JoinedStr):
            parts = (str(part.value) if isinstance(part, ast.Constant) else "0" for part in value.values)
            yield value.lineno, "".join(parts)
        elif isinstance(value, ast.IfExp):
            yield from _texts(value.body, value.orelse)
        elif isinstance(value, ast.BinOp):
            yield from _texts(value.left, value.right)
        elif isinstance(value, ast.Dict):
            yield from _texts(*value.values)
