"""Numbers in hand-written pages: none was measured, and what was chosen is still what the code says."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from vto_pipeline.bench.docs.prose import figures_in
from vto_pipeline.io.documents import load_yaml

CHOSEN, PACKAGE = "docs/source/chosen.yaml", "vto_pipeline"
"""Under the project's root: the numbers that were chosen, and the code that says so."""
_LINE_OF = re.compile(r"(\S+\.py): (.+)")


def page_faults(root: Path, generated: Collection[str]) -> Iterator[str]:
    """Yield a line for each figure that is typed into a hand-written page, and each chosen number that no longer holds.

    Args:
        root: The project's folder.
        generated: The pages that are made from templates, whose sources are checked instead.
    """
    path, docs = root / CHOSEN, root / "docs"
    chosen = load_yaml(path).data if path.is_file() else {}
    pages = {page.relative_to(docs).as_posix(): page for page in sorted(docs.rglob("*.md"))}
    by_hand = {name: page for name, page in pages.items() if f"docs/{name}" not in generated}
    yield from (f"{CHOSEN}: {name} is not a page written by hand" for name in chosen if name not in by_hand)
    for name, page in by_hand.items():
        yield from _faults_of(page.read_text(encoding="utf-8"), name, chosen.get(name, {}))
    for reason in sorted({reason for said in chosen.values() for reason in said.values()}):
        stands = _LINE_OF.fullmatch(reason)
        code = root / PACKAGE / stands[1] if stands else path
        if stands and not (code.is_file() and stands[2] in code.read_text(encoding="utf-8")):
            yield f"{CHOSEN}: {stands[1]} does not hold {stands[2]!r}; say on the page what it holds now"


def _faults_of(text: str, name: str, said: Mapping[str, str]) -> Iterator[str]:
    for phrase in said:
        spaced = r"\s+".join(map(re.escape, phrase.split()))
        words = re.compile(rf"(?<![\w.,]){spaced}(?!\w)")
        if not words.search(text):
            yield f"{CHOSEN}: {name} does not say {phrase!r}"
        text = words.sub(lambda hit: "\n" * hit[0].count("\n"), text)
    for fault in figures_in(text):
        yield f"docs/{name}:{fault.line}: {fault.problem}; name the command that measures it"
