"""The page of tolerances: a study that ``msrr tolerance`` has run, as Markdown with its figure.

msrr tolerance close_range --out runs/tolerance
python docs/make_tolerance.py runs/tolerance
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from msrr_bullet.tolerance import wording
from msrr_bullet.tolerance.error_budget import contributions
from msrr_bullet.tolerance.model import EffectResult, ToleranceStudy
from msrr_bullet.tolerance.tornado_plot import draw_tornado

DOCS = Path(__file__).resolve().parent
FIGURE = Path("images/tornado.png")

INTRODUCTION = """\
# What to build more precisely first

What each deviation of a robot from its drawing (an *effect*) costs alone, and what all of them cost
together in each [grade](../explanation/as_built.md), on `{scene}`. While an effect is tried alone, the
robots know the tolerances of the scene ({told}) but no error, and all else, the optics of the cameras
included, is that of perfect calibration. There are {seeds} seeds for each effect, the same for all.
`msrr tolerance {scene}` prints these figures and writes a page that also says how they are measured;
`python docs/make_tolerance.py FOLDER` makes this page of it.
"""

TOGETHER = """\
## All together
Every trial draws the errors of its robot anew. In brackets, and *by the parts*: what the effects alone
predict if they are independent.
"""

FIRST = """\
## One by one
*Docks to, and no longer*: two sizes of the effect found by bisection, at the first of which at least 95 %
of the trials dock, and at the second fewer. An effect uses up as much of *what docking tolerates* as its
standard deviation is of that size (of 1.96 times that size where it is drawn for each tag); *no limit
found* means that it docks at the largest size that was tried, and counts as nothing used up. Both shares
are those of squares in the sum of the squares of all effects. First come the effects that use up most.
"""

FIGURE_TEXT = """\
![What one step of each effect adds to the lateral error, and up to which size the unit docks]({figure})

Left: root mean square of the lateral error that one standard deviation of `careful` adds, or, hatched, that
the size named beside the effect adds, where no grade has it. Right: the size to which the unit docks, in
steps.
"""

SLOPES = """\
## Per unit
Change of the signed errors at contact per unit of the effect, root mean square with its 95 % interval. *To
one side*: the part that is the same in every trial, positive to the left. {chance}
Where the lower bound is 0 then, an effect cannot be told from chance.
"""


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (columns, ["---"] * len(columns), *rows)) + "\n"


def slope_cells(effect: EffectResult) -> list[str]:
    """Return the row of an effect in the table of slopes."""
    return [
        f"`{effect.name}` [{effect.unit or 1}]",
        wording.limit(effect),
        wording.slope(effect.lateral),
        wording.systematic(effect.lateral),
        wording.slope(effect.yaw),
        wording.beyond(effect),
    ]


def page(study: ToleranceStudy) -> str:
    """Return the page of a study."""
    found = contributions(study)
    cells = [wording.grade_cells(sample, found, study.all_graded) for sample in study.grades]
    grades = table(wording.GRADE_COLUMNS, cells)
    columns = ("effect", "docks to, and no longer", "mm", "of it to one side", "deg", "how trials beyond end")
    return "\n".join(
        [
            INTRODUCTION.format(scene=study.scene, told=study.told, seeds=len(study.seeds)),
            "\n".join(f"- {text}" for text in wording.findings(study, found)) + "\n",
            TOGETHER,
            grades,
            FIRST,
            table(wording.FIRST_COLUMNS, map(wording.first_cells, found)),
            FIGURE_TEXT.format(figure=f"../{FIGURE.as_posix()}"),
            SLOPES.format(chance=wording.chance(study)),
            table(columns, map(slope_cells, study.effects)),
        ]
    )


def main(folder: Annotated[Path, typer.Argument(exists=True, file_okay=False)]) -> None:
    """Write the page and its figure from the study in a folder."""
    study = ToleranceStudy.model_validate_json((folder / "tolerance.json").read_text(encoding="utf-8"))
    draw_tornado(study, DOCS / FIGURE)
    (DOCS / "results" / "tolerance.md").write_text(page(study), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
