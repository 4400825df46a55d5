"""Markdown page of the gallery: a description, a table of all flights, and the pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from outrider.gallery.figures import Panel, outcome
from outrider.gallery.showings import WAYS

TITLE = "# Every method in every scenario\n"
_HEAD = (
    TITLE
    + """
Each shipped scenario, flown once from the air with seed {seed} in full physics over MAVLink: by the four
methods of the field, and certified. Coloured lines are the vehicles' paths from above, from the ring to the
dot; grey is what is in the way; the star is the target, the dotted line its way. Below each: the least
distance of any two vehicles, and d_min in red; for escorts also the distance from the surface around the
target: a line for its median, a band up to its largest. All panels of a row have the same axes. One flight is
a picture, no measurement: for figures over many seeds see docs/results.md. A target shares no plan and gives
way to no vehicle: separation from it is not proven. Certified vehicles fly their plans to the end and wait
there while two clocks differ by more than twice `certified.clock_us`, as in `rough`. A click on a picture
opens it in full size.

`outrider gallery --page docs/gallery` makes this page.

| scenario | {ways} |
|---|{rules}
"""
)


def page(panels: Mapping[str, Sequence[Panel]], descriptions: Mapping[str, str], seed: int) -> str:
    """Return the Markdown, for pictures named ``SCENARIO.png`` beside it."""
    ways = " | ".join(way.replace("_", " ") for way in WAYS)
    text = _HEAD.format(seed=seed, ways=ways, rules="---|" * len(WAYS))
    for scenario, of in panels.items():
        cells = " | ".join(outcome(run).replace("|", "/") for _, run, _ in of)
        text += f"| [{scenario}](#{scenario}) | {cells} |\n"
    for scenario in panels:
        said = descriptions[scenario]
        text += f"\n## {scenario}\n\n{said[:1].upper()}{said[1:]}.\n\n"
        text += f"[![{scenario}]({scenario}.png)]({scenario}.png)\n"
    return text
