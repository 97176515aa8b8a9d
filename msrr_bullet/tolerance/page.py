"""The page of a tolerance study: one HTML file with its figure inside, and the files beside it."""

from __future__ import annotations

import base64
from itertools import count
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from msrr_bullet.statistics import wilson
from msrr_bullet.tolerance import wording
from msrr_bullet.tolerance.effects import RANGE
from msrr_bullet.tolerance.error_budget import contributions
from msrr_bullet.tolerance.model import ToleranceStudy
from msrr_bullet.tolerance.threshold_search import RESOLUTION
from msrr_bullet.tolerance.tornado_plot import draw_tornado
from msrr_bullet.tolerance.trial_plan import REQUIRED
from msrr_scenes.whole_files import write_whole


def write_study(study: ToleranceStudy, folder: Path) -> Path:
    """Write ``tolerance.html``, ``tolerance.json`` and the figure for light and dark pages to a folder.

    Returns:
        The page, which needs neither the other files nor a network.
    """
    write_whole(folder / "tolerance.json", study.to_json())
    light = draw_tornado(study, folder / "tornado.png")
    dark = draw_tornado(study, folder / "tornado-dark.png", dark=True)
    environment = Environment(
        loader=PackageLoader("msrr_bullet.tolerance", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found = contributions(study)
    page = environment.get_template("page.html.j2").render(
        study=study,
        found=found,
        wording=wording,
        tornado=base64.b64encode(light.read_bytes()).decode(),
        tornado_dark=base64.b64encode(dark.read_bytes()).decode(),
        resolution=RESOLUTION,
        range=RANGE,
        bound=wilson(len(study.seeds), len(study.seeds)).low,
        needed=next(n for n in count(1) if wilson(n, n).low >= REQUIRED),
    )
    path = folder / "tolerance.html"
    write_whole(path, page)
    return path
