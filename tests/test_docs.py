"""The pages: what they quote stands in results files, their prose is plain, their links lead somewhere."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from vto_pipeline.bench import BENCHES
from vto_pipeline.bench.docs.__main__ import faults
from vto_pipeline.bench.docs.chosen import CHOSEN, PACKAGE
from vto_pipeline.bench.docs.pages import FIGURES, RESULTS, SOURCES, render_pages
from vto_pipeline.bench.docs.prose import LONGEST, count_words, figures_in, long_sentences, typed_figures
from vto_pipeline.bench.docs.results import Results
from vto_pipeline.bench.sample_runs import SAMPLES
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.garment.sizes.rules import read_rules
from vto_pipeline.io.bodies.measurements import read_measurements
from vto_pipeline.io.captures.photos import read_board
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.motion.keyframes import parse_keyframes
from vto_pipeline.io.patterns.seam_lines import read_seam_lines
from vto_pipeline.io.patterns.sewing_plan import read_sewing_plan
from vto_pipeline.pipeline.batch.order import read_order
from vto_pipeline.stages.entry.planning import catalogue, planned

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def first_key(block: str) -> str:
    return next(line for line in block.splitlines() if not line.startswith("#")).split(":")[0]


BLOCKS = [
    (page.name, block) for page in PAGES for block in re.findall(r"```yaml\n(.*?)```", page.read_text(), flags=re.S)
]
EXAMPLES = [(name, block) for name, block in BLOCKS if first_key(block) != "given"]
"""All that is not a part of a document only."""

ROW = {
    "scene": "hang 32",
    "method": "newton",
    "settings": {"substeps": 2},
    "vertices": 1024,
    "seconds": 0.3456,
    "errors": {"rms_stretch": 1.7e-5, "share": 0.123, "status": "reached", "crossings": 0, "settled": True},
    "runs": 3,
    "compile_s": 0.0,
    "threads": 1,
}
MACHINE = {"cpu": "a processor", "cores": 2, "threads": 1, "memory_gb": 25.3, "load_at_start": 0.5}


def document(*rows: dict) -> dict:
    head = {"bench": "toy", "command": "vto bench toy", "commit": "0123456789ab", "date": "2026-11-23"}
    return {**head, "machine": MACHINE, "quick": True, "rows": list(rows), "fronts": "a toy has none"}


@pytest.fixture
def project(tmp_path):
    """A project with one page, one results file and a README."""
    (tmp_path / SOURCES / "benchmarks").mkdir(parents=True)
    (tmp_path / RESULTS).mkdir(parents=True)
    other = {**ROW, "method": "xpbd", "seconds": 2.0}
    (tmp_path / RESULTS / "toy.json").write_text(json.dumps(document(ROW, other)))
    source = '# Toy\n\nIt takes {{ figure("toy", "seconds", method="newton") }} s for {{ chosen("1 m") }}.\n'
    (tmp_path / SOURCES / "benchmarks" / "toy.md.j2").write_text(source)
    (tmp_path / SOURCES / "README.md.j2").write_text("# A project\n")
    for name, text in render_pages(tmp_path).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_the_pages_are_what_sources_and_results_say_and_read_well():
    assert list(faults(ROOT)) == []


def test_every_page_names_its_figures_with_command_and_file(project):
    assert "It takes 0.35 s for 1 m." in (project / "docs/benchmarks/toy.md").read_text()
    assert (
        "| 0.35 | hang 32, newton: seconds | [toy.json](../results/toy.json) | 2026-11-23, `0123456789ab` | "
        "`vto bench toy` |" in (project / FIGURES).read_text()
    )
    assert list(faults(project)) == []


def test_another_result_makes_the_page_stale(project):
    path = project / RESULTS / "toy.json"
    path.write_text(path.read_text().replace("0.3456", "0.4567"))
    assert [line.split(":")[0] for line in faults(project)] == ["docs/benchmarks/toy.md", FIGURES]


def test_an_edited_page_is_stale(project):
    page = project / "docs/benchmarks/toy.md"
    page.write_text(page.read_text().replace("0.35", "0.34"))
    assert [line.split(":")[0] for line in faults(project)] == ["docs/benchmarks/toy.md"]


@pytest.mark.parametrize(
    ("asked", "problem"),
    [
        ('figure("toy", "seconds", method="rk4")', "no row with method='rk4'"),
        ('figure("toy", "seconds")', "2 rows where one was expected"),
        ('figure("toy", "meters", method="newton")', "no figure meters"),
        ('figure("absent", "seconds")', "no such file"),
        ('rows("toy").total("status")', "not a number"),
        ("figure(", "unexpected"),
        ("misspelt", "undefined"),
    ],
)
def test_what_no_result_has_is_an_error_that_names_the_page(project, asked, problem):
    source = project / SOURCES / "benchmarks" / "toy.md.j2"
    source.write_text(f"{{{{ {asked} }}}}")
    with pytest.raises(ConfigError, match=re.escape(problem)) as raised:
        render_pages(project)
    assert str(source) in raised.value.where


def test_results_that_do_not_say_where_they_come_from_are_refused(project):
    path = project / RESULTS / "toy.json"
    path.write_text(json.dumps({"rows": [ROW]}))
    with pytest.raises(InputError, match="without command, commit, date, machine"):
        Results(project / RESULTS).rows("toy")


@pytest.mark.parametrize(
    ("key", "form", "text"),
    [
        ("seconds", {}, "0.35"),
        ("seconds", {"places": 1}, "0.3"),
        ("seconds", {"scale": 1000, "significant": 3}, "346"),
        ("rms_stretch", {}, "1.7e-5"),
        ("share", {"scale": 100, "places": 0}, "12"),
        ("vertices", {}, "1,024"),
        ("crossings", {}, "0"),
        ("status", {}, "reached"),
        ("settled", {}, "yes"),
    ],
)
def test_how_a_figure_is_written(project, key, form, text):
    assert Results(project / RESULTS).figure("toy", key, method="newton", **form) == text


def test_figures_over_several_rows(project):
    rows = Results(project / RESULTS).rows("toy", scene="hang *")
    assert (rows.least("seconds"), rows.most("seconds"), rows.total("seconds")) == ("0.35", "2.0", "2.3")
    assert (rows.count(), rows.count("status", "reached"), rows.count("status", "failed")) == ("2", "2", "0")
    assert [row.method for row in rows] == ["newton", "xpbd"]


def test_a_figure_typed_by_hand_is_found():
    typed = (
        'within 3.6 mm\n{{ figure("toy", "seconds") }} s\n`2 s`\n| 86 % | 1.7e-5 | 12 GB |\n1/60 s, ISO 8559, 3 files'
    )
    assert [(fault.line, fault.problem.split(": ")[1]) for fault in typed_figures(typed)] == [
        (1, "3.6 mm"),
        (4, "86 %"),
        (4, "1.7e-5"),
        (4, "12 GB"),
    ]


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("{{ 0.17 }} mm", ["0.17"]),
        ("\n{{ '0.17 mm' }}", ["0.17 mm"]),
        ("{% set median = '0.17' %}{{ median }} mm", ["0.17"]),
        ("{% if demo %}{{ 3 * 0.2 }}{% endif %}", ["0.2", "3"]),
        ("{{ '%.2f mm' | format(0.17) }}", ["%.2f mm", "0.17"]),
        ("```\nvto run a.yaml  # takes 12 s\nsleep 3 s\n```", ["12 s"]),
        ("{{ figure('toy', 'seconds', edges=40) }} s, {{ rows('toy')[0].figure('share', scale=100) }} %", []),
        ("{{ chosen('2 mm') }}{% for edges in (20, 40) %}{{ edges }}{% endfor %}{{ one.name or 'none' }}", []),
    ],
)
def test_figures_hidden_in_a_template_are_found(typed, found):
    assert sorted(fault.problem.split(": ")[1] for fault in typed_figures(typed)) == sorted(found)


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("| clip | frames |\n|---|---|\n| 131_01 | 994 | 39 to 53 | **23.8** |", ["23.8", "994", "39 to 53"]),
        ("| a | 0 |\n| a | – |\n| 4 | top | sides |\n| 0.5 | of a scale |", ["0", "0.5"]),
        ("in 26 of 40 frames, of 100 pairs, 97 of them", ["26 of 40"]),
        ("26.6 whole frames a second, 30 a second, after a second", ["26.6 whole frames a second", "30 a second"]),
        ("at least 26 dB and 0.85, 16 degrees, 30°, in 11 frames", ["0.85", "11 frames", "16 degrees", "26 dB", "30°"]),
        ("`--fps 30 a second`, figure 3, ISO 8559-1, 33 of MediaPipe, [ten](a/1.5/b.md), ![x](0.5.png)", []),
    ],
)
def test_what_looks_measured_is_found(typed, found):
    assert sorted(fault.problem.split(": ")[1].strip("*") for fault in figures_in(typed)) == sorted(found)


@pytest.fixture
def by_hand(project):
    """Write a page by hand, what was chosen in it, and a line of code; return what is wrong."""

    def found(page: str, chosen: str = "", code: str = "") -> list[str]:
        (project / "docs" / "hand.md").write_text(page)
        (project / CHOSEN).write_text(chosen or "{}\n")
        (project / PACKAGE).mkdir(exist_ok=True)
        (project / PACKAGE / "setting.py").write_text(code)
        return list(faults(project))

    return found


def test_a_figure_typed_into_a_page_by_hand_is_found(by_hand):
    (fault,) = by_hand("# By hand\n\nIt takes 12 s, and no\nlonger.\n")
    assert fault.startswith("docs/hand.md:3: typed by hand: 12 s")
    assert by_hand("# By hand\n\nIt takes a while: see `vto bench`.\n") == []


def test_what_was_chosen_may_be_typed_while_it_is_so(by_hand):
    page, code = "It waits for 12\ns. It ends after 112 s.\n", "WAIT_S = 12.0  # of a server\n"
    (fault,) = by_hand(page, 'hand.md:\n  12 s: "setting.py: WAIT_S = 12.0"\n', code)
    assert fault.startswith("docs/hand.md:2: typed by hand: 112 s")
    allowed = 'hand.md:\n  waits for 12 s: "setting.py: WAIT_S = 12.0"\n  after 112 s: an example\n'
    assert by_hand(page, allowed, code) == []
    (fault,) = by_hand(page, allowed, "WAIT_S = 13.0\n")
    assert fault.startswith(f"{CHOSEN}: setting.py does not hold 'WAIT_S = 12.0'")


@pytest.mark.parametrize(
    ("chosen", "problem"),
    [
        ("hand.md: {12 s: an example}", "hand.md does not say '12 s'"),
        ("lost.md: {12 s: an example}", "lost.md is not a page written by hand"),
        ("benchmarks/toy.md: {0.35 s: an example}", "benchmarks/toy.md is not a page written by hand"),
        ('hand.md: {3 s: "gone.py: WAIT_S = 3"}', "gone.py does not hold 'WAIT_S = 3'"),
    ],
)
def test_what_is_allowed_for_nothing_is_found(by_hand, chosen, problem):
    (fault,) = by_hand("It waits for 3 s.\n" if "gone" in chosen else "It waits.\n", chosen)
    assert fault.startswith(f"{CHOSEN}: {problem}")


def test_long_sentences_are_found_where_they_begin():
    words = " ".join(["word"] * LONGEST)
    skipped = f"| {words} {words} |\n\n```\n{words} {words}\n```\n\n"
    text = f"# Title\n\nFirst {words}.\n\n- {words}.\n\n{skipped}{words}. `Code` {words}.\n"
    assert [fault.line for fault in long_sentences(text)] == [3, 13]


def test_links_code_and_abbreviations_count_as_they_read():
    assert count_words("two [words](somewhere/else.md) - |") == 2
    assert long_sentences("[" + "word " * 20 + "](a b c d e f g h)", longest=20) == []
    assert long_sentences("e.g. This goes on, i.e. it ends here.", longest=7) != []


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", re.sub(r"```.*?```", "", page.read_text(), flags=re.S))
    absent = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert absent == []


@pytest.mark.parametrize(("page", "block"), EXAMPLES, ids=lambda value: str(value).split("\n")[0])
def test_examples_are_read_as_they_stand(page, block, tmp_path):
    path = tmp_path / "example.yaml"
    path.write_text(block.replace("../sample_data", str(ROOT / "sample_data")))
    schemas = {
        "run": lambda: read_order(path),
        "panels": lambda: read_sewing_plan(path),
        "": lambda: planned(path, (), catalogue()),
    }
    kinds = {
        "schema": lambda: schemas["panels" if "\npanels:" in block else "run" if "\nrun:" in block else ""](),
        "name": lambda: read_fabric(path),
        "instrument": lambda: read_fabric(path),
        "sex": lambda: read_measurements(path),
        "columns": lambda: read_board(path),
        "garment": lambda: read_rules(str(path)),
        "unit": lambda: read_seam_lines(path),
        "frames_per_second": lambda: parse_keyframes(str(path)),
    }
    assert kinds[first_key(block)]()


def test_every_results_file_comes_from_a_bench_or_a_sample_run():
    known = {*BENCHES, *SAMPLES, "gpu"}  # the last is measured where there is a graphics processor
    found = {path.stem for path in (ROOT / RESULTS).glob("*.json")}
    assert {name for name in found if not name.startswith("first_run_")} <= known
