"""A whole reproduction on unicycles: its studies, its findings, and the files that are made from it."""

from itertools import islice
from pathlib import Path

import pytest

from msrr_bullet.reproduce import unicycle_studies
from msrr_bullet.reproduce.report.findings import requirements
from msrr_bullet.reproduce.report.ranking import COLUMNS, default_controller_text, ranking_text
from msrr_bullet.reproduce.run import contenders, joined, reproduce, write_all
from msrr_bullet.run_folder import ProgressListener, RunFolderError, locked, progress_log
from msrr_bullet.studies.ablations import VARIANTS
from msrr_bullet.studies.model import Reproduction
from msrr_bullet.studies.settings import HARD, STANDARD
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.spec import Choice


@pytest.fixture(scope="module")
def unicycle_results() -> Reproduction:
    """A whole reproduction on unicycles with one trial and a map of four cells."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unicycle_studies, "GAINS", (0.8, 6.0))
        patch.setattr(unicycle_studies, "LATENCIES", (0.1,))
        patch.setattr(unicycle_studies, "TABLES", (STANDARD, HARD))
        patch.setattr(unicycle_studies, "STABILITY_SETTINGS", unicycle_studies.STABILITY_SETTINGS[:1])
        patch.setattr("msrr_bullet.studies.ablations.SETTINGS", (STANDARD,))
        for phase, variants in VARIANTS.items():  # each takes half a second
            patch.setitem(VARIANTS, phase, dict(islice(variants.items(), 1)))
        contenders = {
            "long": {"C1": Choice(name="c1")},
            "close": {"C1": Choice(name="c1"), "CBF": Choice(name="cbf")},
        }
        return unicycle_studies.reproduce_unicycle(range(1), contenders)


def test_every_study_is_in_the_results(unicycle_results: Reproduction) -> None:
    tables = [(t.phase, t.setting, [r.label for r in t.rows]) for t in unicycle_results.tables]
    close = ["C1", "CBF"]
    assert tables == [
        ("long", "standard", ["C1"]),
        ("long", "hard", ["C1"]),
        ("close", "standard", close),
        ("close", "hard", close),
    ]
    assert {p.phase: list(p.series) for p in unicycle_results.panels} == {"long": ["C1"], "close": close}
    for ablations in unicycle_results.ablations:
        (table,) = ablations.tables
        assert table.phase == ablations.phase
        assert [r.label for r in table.rows] == list(VARIANTS[ablations.phase])[:1]
    assert [(m.compensated, len(m.gains)) for m in unicycle_results.maps] == [(False, 2), (True, 1)]
    (figure6,) = unicycle_results.figure6
    gain, latency = unicycle_results.maps[0].paper_cell
    assert figure6.description.startswith(f"gain {gain:g} 1/s, ")
    assert f", {1e3 * latency:g} ms that" in figure6.description
    assert unicycle_results.seeds == {"unicycle": (0, 1)}


def test_requirements_are_answered_from_the_tables(unicycle_results: Reproduction) -> None:
    answered = requirements(unicycle_results)
    assert sum("C1, unicycle" in r.text for r in answered) == 5
    table = unicycle_results.table("close", "unicycle", "standard")
    assert table is not None
    final = table.rows[0].measures["final"].quantiles.p95
    assert final is not None
    assert any(f"/ {1e3 * final:.3g} mm" in r.result for r in answered)


def test_the_laws_are_ranked_by_the_tables(unicycle_results: Reproduction) -> None:
    assert "CBF" in default_controller_text(unicycle_results)
    head, rule, *rows = ranking_text(unicycle_results).splitlines()
    assert {line.count("|") for line in (head, rule, *rows)} == {len(COLUMNS) + 1}
    assert len(rows) == 2


@pytest.mark.nightly
def test_the_same_results_give_the_same_files(unicycle_results: Reproduction, tmp_path: Path) -> None:
    """Also those that were read from the JSON file; with one figure of each kind."""
    every = unicycle_results
    results = every.model_copy(
        update={
            "tables": every.tables[:1],
            "panels": every.panels[:1],
            "maps": every.maps[:1],
            "ablations": every.ablations[:1],
        }
    )
    folders = (tmp_path / "first", tmp_path / "again")
    for folder in folders:
        folder.mkdir()
    write_all(results, folders[0])
    loaded = Reproduction.model_validate_json((folders[0] / "reproduction.json").read_text())
    assert loaded == results
    write_all(loaded, folders[1])
    first, again = ({path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders)
    assert first == again
    assert len(first) == 2 + 5


def test_several_reproductions_are_joined(unicycle_results: Reproduction) -> None:
    other = Reproduction(versions={}, seeds={"bullet": (0, 2)}, tables=unicycle_results.tables[:1])
    both = joined([unicycle_results, other])
    assert both.tables == (*unicycle_results.tables, unicycle_results.tables[0])
    assert both.seeds == {"unicycle": (0, 1), "bullet": (0, 2)}
    assert both.versions == unicycle_results.versions


def test_the_contenders_are_shipped_then_tuned() -> None:
    labels = list(contenders("docking"))
    assert labels[:5] == ["C1", "C2 (our reading)", "LINEAR", "CBF", "GRACEFUL"]
    assert all(label.endswith(", tuned") for label in labels[5:])


@pytest.mark.nightly
def test_a_reproduction_writes_report_figures_and_json_and_tells_its_progress(
    unicycle_results: Reproduction, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def quick(seeds: range, compared: object, pool: object, on_progress: ProgressListener) -> Reproduction:
        on_progress("one study")
        return unicycle_results

    monkeypatch.setattr("msrr_bullet.reproduce.run.reproduce_unicycle", quick)
    lines: list[str] = []
    out = tmp_path / "out"
    assert reproduce(out, unicycle=range(2), on_progress=lines.append) == unicycle_results
    assert lines == ["one study", "figures and report"]
    written = (out / "progress.txt").read_text().splitlines()
    assert [line.split(maxsplit=2)[2] for line in written] == lines
    text, images = (out / "report.html").read_text(), sorted(out.glob("*.png"))
    assert text.count("data:image/png;base64,") == len(images) > 8
    assert 'src="http' not in text
    for image in images:
        assert image.read_bytes().startswith(b"\x89PNG")
    assert Reproduction.model_validate_json((out / "reproduction.json").read_text()) == unicycle_results


def test_a_folder_is_for_one_reproduction_at_a_time(tmp_path: Path) -> None:
    """Of two, one cut off the line that the other was writing."""
    with locked(tmp_path), pytest.raises(MsrrError, match="under way in this folder; choose another --out"):
        reproduce(tmp_path, unicycle=range(1))


@pytest.mark.parametrize(
    ("mission", "said"),
    [
        ("two_unit", "did you mean 'two_units'"),
        ("dock_again", "a base station leads"),
        ("close_range", "no long-distance phase"),
    ],
)
def test_a_mission_that_cannot_be_measured_is_refused_before_the_studies(
    mission: str, said: str, tmp_path: Path
) -> None:
    lines: list[str] = []
    with pytest.raises(MsrrError, match=said):
        reproduce(tmp_path, unicycle=range(1), bullet=range(1), mission=mission, on_progress=lines.append)
    assert lines == []


def test_progress_that_finds_no_room_names_its_file(tmp_path: Path) -> None:
    """The error of a full disk names none."""
    (tmp_path / "progress.txt").symlink_to("/dev/full")
    with pytest.raises(RunFolderError, match=r"progress\.txt: cannot be written \(No space left on device\)"):
        progress_log(tmp_path, lambda text: None)("half done")
