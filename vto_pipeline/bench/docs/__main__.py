"""`python -m vto_pipeline.bench.docs` writes README.md and docs/ from templates and results; --check tests them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from vto_pipeline.bench.docs.chosen import page_faults
from vto_pipeline.bench.docs.pages import SOURCES, render_pages
from vto_pipeline.bench.docs.prose import README_WORDS, count_words, long_sentences, typed_figures
from vto_pipeline.errors import VtoError
from vto_pipeline.io.files import replacing


def faults(root: Path) -> Iterator[str]:
    """Yield what is wrong with the pages under a project's root, a line each: stale, wordy, or typed by hand.

    Raises:
        ConfigError: a template asks for a figure that no results file has.
    """
    generated = render_pages(root)
    for name, text in generated.items():
        page = root / name
        if not page.is_file() or page.read_text(encoding="utf-8") != text:
            yield f"{name}: not what its source and results say; run `make docs`"
    for page in [root / "README.md", *sorted((root / "docs").rglob("*.md"))]:
        text = page.read_text(encoding="utf-8")
        yield from (f"{page.relative_to(root)}:{fault.line}: {fault.problem}" for fault in long_sentences(text))
    words = count_words((root / "README.md").read_text(encoding="utf-8"))
    if words > README_WORDS:
        yield f"README.md: {words} words, at most {README_WORDS}"
    for source in sorted((root / SOURCES).rglob("*.md.j2")):
        found = typed_figures(source.read_text(encoding="utf-8"))
        yield from (f"{source.relative_to(root)}:{fault.line}: {fault.problem}" for fault in found)
    yield from page_faults(root, generated)


def main() -> int:
    """Read the command line; write the pages, or say what is wrong with them."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.docs", description=__doc__)
    parser.add_argument("--root", type=Path, default=Path(), help="the project's folder")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a page is wrong")
    arguments = parser.parse_args()
    try:
        if arguments.check:
            found = list(faults(arguments.root))
            sys.stdout.writelines(f"{line}\n" for line in found)
            return int(bool(found))
        for name, text in render_pages(arguments.root).items():
            with replacing(arguments.root / name) as beside:
                beside.write_text(text, encoding="utf-8")
    except VtoError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
