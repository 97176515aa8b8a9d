"""``msrr reproduce``: runs the studies, draws the figures, writes report and JSON."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from datetime import datetime
from functools import partial
from pathlib import Path

from pydantic import ValidationError

from msrr_bullet.reproduce.bullet_part import paper_experiments, reproduce_bullet
from msrr_bullet.reproduce.report.ablation_plot import draw_ablations
from msrr_bullet.reproduce.report.html import strip_title, write_report
from msrr_bullet.reproduce.report.map_plot import draw_map
from msrr_bullet.reproduce.report.panel_plot import draw_panels
from msrr_bullet.reproduce.report.strip_plot import draw_strips
from msrr_bullet.reproduce.unicycle_part import Contenders, reproduce_unicycle
from msrr_bullet.studies.model import Reproduction
from msrr_bullet.studies.search_space import Part
from msrr_bullet.studies.settings import STANDARD
from msrr_bullet.studies.tuned_scenes import tuned_choice
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.spec import Choice

#: The laws in the order in which they are shown, by phase.
_LAWS: dict[Part, tuple[str, ...]] = {
    "assembly": ("c1", "c2"),
    "docking": ("c1", "c2", "linear", "cbf", "graceful"),
}

Tell = Callable[[str], None]


def contenders(part: Part) -> dict[str, Choice]:
    """Return the controllers of one part by label: as they ship, then as tuned."""
    found = {name.upper(): Choice(name=name) for name in _LAWS[part]}
    for name in _LAWS[part]:
        tuned = tuned_choice(part, name)
        if tuned is not None:
            found[f"{name.upper()}, tuned"] = tuned
    return found


def reproduce(
    out: Path,
    *,
    unicycle: range | None,
    bullet: range | None = None,
    jobs: int = 1,
    mission: str = "two_units",
    tell: Tell | None = None,
) -> Reproduction:
    """Reproduce the paper; write ``report.html``, ``reproduction.json`` and the PNGs to ``out``.

    ``out/progress.txt`` gets a line for each thing that is told, so that a run in the background can be
    followed. A run of the real loop that was stopped goes on from ``out/trials`` if scenes and code are
    still the same.

    Args:
        out: Folder, made if need be.
        unicycle: Seeds of the unicycle studies; None leaves them out.
        bullet: Seeds of the trials of the real loop; None leaves them out.
        jobs: Processes.
        mission: Scene of the whole mission.
        tell: Is told what is done next.
    """
    out.mkdir(parents=True, exist_ok=True)
    tell = partial(_tell, out / "progress.txt", tell)
    found: list[Reproduction] = []
    if unicycle is not None:
        by_phase: Contenders = {"long": contenders("assembly"), "close": contenders("docking")}
        if jobs > 1:
            # Spawned, never forked: a child of a process with threads may wait for a lock for ever.
            context = multiprocessing.get_context("spawn")
            with ProcessPoolExecutor(jobs, mp_context=context) as pool:
                found.append(reproduce_unicycle(unicycle, by_phase, pool, tell))
        else:
            found.append(reproduce_unicycle(unicycle, by_phase, None, tell))
    if bullet is not None:
        docking = {name.upper(): Choice(name=name) for name in _LAWS["docking"]}
        experiments = paper_experiments(docking, mission)
        found.append(reproduce_bullet(experiments, bullet, out / "trials", jobs, tell))
    whole = joined(found)
    tell("figures and report")
    write_all(whole, out)
    return whole


def _tell(file: Path, listener: Tell | None, text: str) -> None:
    with file.open("a", encoding="utf-8") as lines:
        lines.write(f"{datetime.now():%Y-%m-%d %H:%M:%S} {text}\n")
    if listener is not None:
        listener(text)


def redraw(out: Path) -> Path:
    """Draw figures and report anew from the ``reproduction.json`` in ``out``; return the report's path.

    Raises:
        MsrrError: There is none, or it is of another version.
    """
    file = out / "reproduction.json"
    try:
        found = Reproduction.model_validate_json(file.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        raise MsrrError(f"{file}: no findings of this version of msrr reproduce: {error}") from error
    return write_all(found, out)


def joined(parts: list[Reproduction]) -> Reproduction:
    """Return several reproductions as one."""
    whole = parts[0]
    for part in parts[1:]:
        whole = Reproduction(
            versions=whole.versions,
            seeds={**whole.seeds, **part.seeds},
            tables=whole.tables + part.tables,
            panels=whole.panels + part.panels,
            maps=whole.maps + part.maps,
            ablations=whole.ablations + part.ablations,
            seconds={**whole.seconds, **part.seconds},
        )
    return whole


def write_all(found: Reproduction, out: Path) -> Path:
    """Write figures, JSON and report; return the report's path."""
    (out / "reproduction.json").write_text(found.to_json(), encoding="utf-8")
    figures: dict[str, Path] = {}
    for table in found.tables:
        figures[strip_title(table)] = draw_strips(table, out / _file(strip_title(table)))
    for chart in found.maps:
        title = f"Gain and delay: {'compensated' if chart.compensated else 'uncompensated'}"
        figures[title] = draw_map(chart, out / _file(title))
    for ablation in found.ablations:
        title = f"Ablations, {ablation.phase}"
        figures[title] = draw_ablations(ablation, out / _file(title))
    los = STANDARD.dock_setup().los
    for panels in found.panels:
        for name in panels.series:
            title = f"Panels: {panels.phase}, {name}"
            figures[title] = draw_panels(panels, name, out / _file(title), (los.inner_deg, los.outer_deg))
    return write_report(found, figures, out / "report.html")


def _file(title: str) -> str:
    kept = "".join(c if c.isalnum() else " " for c in title.lower())
    return "-".join(kept.split()) + ".png"
