"""The files of a reproduction: report, figures and the JSON from which both are made."""

from pathlib import Path

import pytest

from msrr_bullet.reproduce.progress import ProgressListener
from msrr_bullet.reproduce.run import contenders, joined, reproduce, write_all
from msrr_bullet.studies.model import Reproduction


def test_report_figures_and_json(unicycle_results: Reproduction, tmp_path: Path) -> None:
    text = write_all(unicycle_results, tmp_path).read_text()
    images = sorted(tmp_path.glob("*.png"))
    assert text.count("data:image/png;base64,") == len(images) > 8
    assert 'src="http' not in text
    for image in images:
        assert image.read_bytes().startswith(b"\x89PNG")
    loaded = Reproduction.model_validate_json((tmp_path / "reproduction.json").read_text())
    assert loaded == unicycle_results
    again = tmp_path / "again"
    again.mkdir()
    assert write_all(loaded, again).read_text() == text
    for image in images:
        assert (again / image.name).read_bytes() == image.read_bytes()


def test_several_reproductions_are_joined(unicycle_results: Reproduction) -> None:
    other = Reproduction(versions={}, seeds={"bullet": (0, 2)}, tables=unicycle_results.tables[:1])
    both = joined([unicycle_results, other])
    assert both.tables == (*unicycle_results.tables, unicycle_results.tables[0])
    assert both.seeds == {"unicycle": (0, 3), "bullet": (0, 2)}
    assert both.versions == unicycle_results.versions


def test_the_contenders_are_shipped_then_tuned() -> None:
    labels = list(contenders("docking"))
    assert labels[:5] == ["C1", "C2 (our reading)", "LINEAR", "CBF", "GRACEFUL"]
    assert all(label.endswith(", tuned") for label in labels[5:])


def test_progress_goes_to_the_listener_and_to_a_file(
    unicycle_results: Reproduction, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def quick(seeds: range, compared: object, pool: object, on_progress: ProgressListener) -> Reproduction:
        on_progress("one study")
        return unicycle_results

    monkeypatch.setattr("msrr_bullet.reproduce.run.reproduce_unicycle", quick)
    lines: list[str] = []
    assert reproduce(tmp_path / "out", unicycle=range(3), on_progress=lines.append) == unicycle_results
    assert lines == ["one study", "figures and report"]
    written = (tmp_path / "out" / "progress.txt").read_text().splitlines()
    assert [line.split(maxsplit=2)[2] for line in written] == lines
    assert (tmp_path / "out" / "report.html").is_file()
