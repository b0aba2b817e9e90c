"""Sample data with truth, measuring against it, and the benches of `vto bench`.

bench, record, timing, machine, provenance: what a bench is, how it is carried out, and on what
sources: the files that figures depend on, and which have changed since
measures: what several benches read off a cloth
own_process, live_rows: commands that are run one by one, and their rows
printed_table: rows in Markdown as they come
sample_runs: the sample documents, run and held against the truth
report_card/: what results say as a whole: the fronts of error against run time, what got better or worse
cloth/, scaling/, physics/, stability/, collision/, drape/, body/, scan/, peers/: the benches
samples/: the sample data and its truth
motion/: how clean motions come out on five bodies; garments in motion
unsewn/: patterns found from garments of known cut
demo: how far a run on the sample data is from the truth
first_run: what `make demo` and `make test` cost from nothing
docs/: README and docs from templates and results
plots/: pictures of their rows
picture, body_gallery: pictures of the docs
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vto_pipeline.bench.bench import Bench
from vto_pipeline.bench.plots.body_plot import draw_body
from vto_pipeline.bench.plots.collision_plot import draw_collision
from vto_pipeline.bench.plots.drape_plot import draw_drape
from vto_pipeline.bench.plots.lines import Curves, draw_curves
from vto_pipeline.bench.plots.scaling_plot import draw_scaling
from vto_pipeline.bench.plots.verdict_table import draw_verdicts


def _draw_solvers(bench: Mapping[str, Any]) -> bytes:
    errors = Curves(figures=("rms_stretch", "distance_mm", "residual"))
    return draw_curves(bench, errors, Curves("iterations", "iterations", ("imbalance_mm", "from_solution_mm")))


def _draw_peers(bench: Mapping[str, Any]) -> bytes:
    return draw_curves(bench, Curves(figures=("rms_stretch", "mean_height_m")))


def _draw_integrators(bench: Mapping[str, Any]) -> bytes:
    return draw_curves(
        bench,
        Curves("h_omega", "step times frequency", ("energy_ratio",)),
        Curves("h_omega", "step times frequency", ("phase_error_deg",), slopes=True),
        Curves("h", "step [s]", ("spin_error",), slopes=True),
        Curves("h", "step [s]", ("energy_drift", "distance_mm"), slopes=True),
        Curves(figures=("energy_drift", "distance_mm")),
    )


def _draw_physics(bench: Mapping[str, Any]) -> bytes:
    errors = ("profile_share", "critical_share", "mode_1_share")
    by_mesh = Curves("edges", "edges along the strip", errors, slopes=True, finer_right=True, split="mesh")
    return draw_curves(bench, by_mesh)


BENCHES = {
    "solvers": Bench(
        "every method on hanging, falling and worn cloth: error against run time",
        "vto_pipeline.bench.cloth.solvers",
        _draw_solvers,
    ),
    "integrators": Bench(
        "energy, phase and momentum against closed forms", "vto_pipeline.bench.cloth.integrators", _draw_integrators
    ),
    "stability": Bench(
        "which methods survive stiff, distorted and extreme cases, and extreme fabrics when worn",
        "vto_pipeline.bench.stability.table",
        draw_verdicts,
    ),
    "physics": Bench(
        "elastica, buckling, drape: error against references", "vto_pipeline.bench.physics", _draw_physics
    ),
    "collision": Bench(
        "queries, broad phase, self-contact, friction: misses, remaining crossings and run time",
        "vto_pipeline.bench.collision",
        draw_collision,
    ),
    "drape": Bench(
        "garments on bodies: error against run time, error prediction, refinement, rest shapes",
        "vto_pipeline.bench.drape",
        draw_drape,
    ),
    "body": Bench(
        "bodies from scans, tape and outlines: error against run time, noise floor, ISO 20685 limits",
        "vto_pipeline.bench.body",
        draw_body,
    ),
    "peers": Bench(
        "MuJoCo, Blender and PositionBasedDynamics beside the default method: error against run time",
        "vto_pipeline.bench.peers",
        _draw_peers,
    ),
    "scaling": Bench(
        "run time at equal error from 1k vertices up, kernels, direct solvers, threads",
        "vto_pipeline.bench.scaling.sizes",
        draw_scaling,
    ),
}
"""Name -> bench. To add one: its file, with `rows(quick, watch)`, and a line here."""
