"""The reproduction of the paper: runs the studies, draws the figures, writes the report and the JSON."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

from msrr_bullet.reproduce.bullet_experiments import paper_experiments, reproduce_bullet
from msrr_bullet.reproduce.figure6 import bullet_figure6
from msrr_bullet.reproduce.report.ablation_plot import draw_ablations
from msrr_bullet.reproduce.report.figure6_plot import draw_figure6
from msrr_bullet.reproduce.report.html import strip_title, write_report
from msrr_bullet.reproduce.report.map_plot import draw_gain_delay_map
from msrr_bullet.reproduce.report.panel_plot import draw_panels
from msrr_bullet.reproduce.report.strip_plot import draw_strips
from msrr_bullet.reproduce.unicycle_studies import Contenders, reproduce_unicycle
from msrr_bullet.run_folder import ProgressListener, locked, make_folder, progress_log
from msrr_bullet.studies.gain_delay import PAPER_LIKE
from msrr_bullet.studies.labels import label_of
from msrr_bullet.studies.model import Reproduction
from msrr_bullet.studies.search_space import Part
from msrr_bullet.studies.settings import STANDARD
from msrr_bullet.studies.tuned_controller import tuned_choice
from msrr_bullet.sweep.spawned_pool import SpawnedPool
from msrr_bullet.sweep.trial_store import study_store
from msrr_scenes.specs.spec import Choice
from msrr_scenes.whole_files import write_whole

#: The laws in the order in which they are shown, by phase.
_LAWS: dict[Part, tuple[str, ...]] = {
    "assembly": ("c1", "c2"),
    "docking": ("c1", "c2", "linear", "cbf", "graceful"),
}


def contenders(part: Part) -> dict[str, Choice]:
    """Return the controllers of one part by label: as they ship, then as tuned."""
    shipped = {label_of(name): Choice(name=name) for name in _LAWS[part]}
    tuned = {label_of(name, tuned=True): tuned_choice(part, name) for name in _LAWS[part]}
    return shipped | {label: choice for label, choice in tuned.items() if choice is not None}


def reproduce(
    out: Path,
    *,
    unicycle: range | None,
    bullet: range | None = None,
    jobs: int = 1,
    mission: str = "two_units",
    on_progress: ProgressListener = lambda text: None,
) -> Reproduction:
    """Reproduce the paper; write ``report.html``, ``reproduction.json`` and the PNGs to ``out``.

    Every line of progress is also written to ``out/progress.txt``, so that a run in the background can be
    followed. An interrupted run of the real loop resumes from ``out/trials.sqlite`` if scene and code are
    unchanged.

    Args:
        out: Folder to write to; it is created if it does not exist.
        unicycle: Seeds of the unicycle studies; None leaves them out.
        bullet: Seeds of the trials of the real loop; None leaves them out.
        jobs: Number of processes.
        mission: Scene of the whole mission.
        on_progress: Called with a line of text that says what is done next.

    Raises:
        MsrrError: The mission does not exist, or cannot be measured, the program failed in a trial, or
            another reproduction is under way in this folder.
    """
    make_folder(out)
    store = study_store(out) if bullet is not None else None  # before the minutes of the studies, too
    docking = {label_of(name): Choice(name=name) for name in _LAWS["docking"]}
    experiments = paper_experiments(docking, mission) if bullet is not None else ()
    for experiment in experiments:  # before the minutes of the studies: a mission may not exist
        for label in experiment.docking:
            experiment.load(label)

    report = progress_log(out, on_progress)
    with locked(out):
        parts: list[Reproduction] = []
        if unicycle is not None:
            pools = SpawnedPool(jobs) if jobs > 1 else nullcontext()
            with pools as pool:
                compared: Contenders = {"long": contenders("assembly"), "close": contenders("docking")}
                parts.append(reproduce_unicycle(unicycle, compared, pool, report))
        if bullet is not None and store is not None:
            found = reproduce_bullet(experiments, bullet, store, jobs, report)
            report("the paper's Fig. 6 in the real loop")
            cell = parts[0].maps[0].paper_cell if parts else PAPER_LIKE
            parts.append(found.model_copy(update={"figure6": (bullet_figure6(bullet.start, cell),)}))
        whole = joined(parts)
        report("figures and report")
        write_all(whole, out)
    return whole


def joined(parts: list[Reproduction]) -> Reproduction:
    """Return the results of several reproductions as one."""
    whole = parts[0]
    for part in parts[1:]:
        pairs = {name: (getattr(whole, name), getattr(part, name)) for name in Reproduction.model_fields}
        whole = Reproduction(**{k: a | b if isinstance(a, dict) else a + b for k, (a, b) in pairs.items()})
    return whole


def write_all(results: Reproduction, out: Path) -> Path:
    """Write figures, JSON and report; return the report's path."""
    write_whole(out / "reproduction.json", results.to_json())
    figures: dict[str, Path] = {}
    for table in results.tables:
        figures[strip_title(table)] = draw_strips(table, out / _file(strip_title(table)))
    for chart in results.maps:
        title = f"Gain and delay: {'compensated' if chart.compensated else 'uncompensated'}"
        figures[title] = draw_gain_delay_map(chart, out / _file(title))
    for ablation in results.ablations:
        title = f"Ablations, {ablation.phase}"
        figures[title] = draw_ablations(ablation, out / _file(title))
    if results.figure6:
        figures["Figure 6"] = draw_figure6(results.figure6, out / _file("figure 6"))
    los = STANDARD.dock_setup().los
    for panels in results.panels:
        for name in panels.series:
            title = f"Panels: {panels.phase}, {name}"
            figures[title] = draw_panels(panels, name, out / _file(title), (los.inner_deg, los.outer_deg))
    return write_report(results, figures, out / "report.html")


def _file(title: str) -> str:
    kept = "".join(c if c.isalnum() else " " for c in title.lower())
    return "-".join(kept.split()) + ".png"
