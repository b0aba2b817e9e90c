"""vto advise"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session

if TYPE_CHECKING:
    from vto_pipeline.assess.size_advice import SizeFit

_BODY = {"chest": "chest_girth", "waist": "waist_girth", "hip": "hip_girth", "thigh": "thigh_girth"}
"""Zone -> girth of the body."""
_NO_SIZE = 4


@click.command("advise")
@click.argument("chart", metavar="CHART", type=PATH)
@click.option("--measurements", type=PATH, required=True, metavar="FILE", help="The customer's tape.")
@click.option(
    "--fit", "kind", metavar="KIND", help="Kind of garment in the table of wearing ease. [default: the chart's]"
)
@message_options
@pass_session
def advise_command(session: Session, chart: Path, measurements: Path, kind: str | None) -> int:
    """Advise a customer on a size: the best one of a chart, the runner-up, and the reason.

    CHART is what vto pattern --sizes writes. Exit code 4: every size is smaller than the body somewhere.

    \b
    vto advise tee_sizes/size_chart.json --measurements customer.yaml
    vto advise tee_sizes/size_chart.json --measurements customer.yaml --fit fitted_shirt
    """
    from vto_pipeline.assess.allowance import read_allowances
    from vto_pipeline.assess.size_advice import rank_sizes
    from vto_pipeline.io.bodies.measurements import read_measurements
    from vto_pipeline.io.size_charts import read_size_chart

    table, tape = read_size_chart(chart), read_measurements(measurements)
    kind = kind or table.allowances
    body = {zone: tape.values[name] for zone, name in _BODY.items() if name in tape.values}
    garment = {
        size: {zone: 2e-3 * row.flat_mm[zone] for zone in _BODY if zone in row.flat_mm}
        for size, row in table.sizes.items()
    }
    ranked = rank_sizes(garment, body, read_allowances(kind), table.may_be_loose)
    best = ranked[0] if ranked[0].wearable else None
    second = next((one for one in ranked[1:] if one.wearable), None)
    unknown = [zone for zone in next(iter(garment.values())) if zone not in body]
    data = {
        "chart": str(chart),
        "fit": kind,
        "best": best and best.size,
        "fits": best is not None and best.fits,
        "runner_up": second and second.size,
        "reason": _reason(ranked),
        "not_measured": unknown,
        "sizes": [_facts(one) for one in ranked],
    }
    lines = [_headline(best, second), f"  {data['reason']}"]
    lines += [f"  {one.size}: {one.reason()}" for one in ranked[1:]]
    lines += [f"  the {zone} of the customer is not given" for zone in unknown]
    session.answer(data, lines)
    return 0 if best is not None else _NO_SIZE


def _headline(best: SizeFit | None, second: SizeFit | None) -> str:
    if best is None:
        return "no size: each is smaller than the body somewhere"
    said = f"{best.size}" if best.fits else f"{best.size}, though it does not fit everywhere"
    return f"{said}; runner-up: {second.size if second else 'none can be worn'}"


def _reason(ranked: list[SizeFit]) -> str:
    return f"{ranked[0].size}: {ranked[0].reason()}"


def _facts(one: SizeFit) -> dict[str, Any]:
    zones = {
        name: {
            "ease_cm": 100 * zone.ease,
            "wanted_cm": [None if bound is None else 100 * bound for bound in (zone.low, zone.high)],
            "off_cm": 100 * zone.off,
        }
        for name, zone in one.zones.items()
    }
    return {"size": one.size, "wearable": one.wearable, "fits": one.fits, "misfit_cm": 100 * one.misfit, "zones": zones}
