"""A card for notebooks: a small picture, facts beside it, and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.report.packing import pack_picture

_CARD = """\
<div style="display:flex;gap:1em;align-items:flex-start">
{% if picture %}<img alt="{{ title }}" src="{{ picture }}" style="background:#fff">{% endif %}
<div><b>{{ title }}</b>
<table>
{% for name, value in facts.items() %}<tr><th style="text-align:left">{{ name }}</th><td>{{ value }}</td></tr>
{% endfor %}</table>
{% for note in notes %}<p>{{ note }}</p>
{% endfor %}
{% if rows %}<table>
<tr>{% for head in rows[0] %}<th>{{ head }}</th>{% endfor %}</tr>
{% for row in rows[1:] %}<tr>{% for value in row %}<td>{{ value }}</td>{% endfor %}</tr>
{% endfor %}</table>{% endif %}
</div></div>
"""


def card(
    title: str,
    picture: ByteArray | None,
    facts: Mapping[str, str],
    notes: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
) -> str:
    """Return a card as HTML that refers to nothing outside; all texts are escaped.

    Args:
        title: What it is.
        picture: sRGB, shape (H, W, 3), or None.
        facts: Name -> value with its unit.
        notes: Sentences below them.
        rows: A table whose first row is its head; empty: none.
    """
    from jinja2 import Environment, StrictUndefined

    shown = None if picture is None else pack_picture(picture)
    template = Environment(autoescape=True, undefined=StrictUndefined).from_string(_CARD)
    return template.render(title=title, picture=shown, facts=facts, notes=notes, rows=rows)
