"""Comparisons of a scene's variants: what is compared, and what counts as slower than before."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import pytest

from msrr_bullet.bench import speed_comparison
from msrr_bullet.bench.speed_comparison import (
    ALLOWED,
    SpeedComparison,
    read_comparison,
    slower_than,
    variants_of,
)
from msrr_bullet.bench.trial_speed import BenchError, TrialSpeed
from msrr_bullet.cli.app import run
from msrr_scenes.specs.mission import ShapeSpec
from msrr_scenes.specs.scene import Scene

Capture = pytest.CaptureFixture[str]


#: The comparison that ships, of the same variants.
STORED = Path(__file__).resolve().parents[3] / "docs" / "results" / "speed" / "close_range.json"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A comparison of the first half second of close_range, as the command writes it.

    Earlier, careful trials cost much more and perfect ones nothing. So perfect ones are measured again, as
    often as may be, and the exit code is 1.
    """
    folder = tmp_path_factory.mktemp("bench")
    stored = read_comparison(STORED)
    changed = {
        name: stored.variants[name].model_copy(update={"physics_alone_ms_per_s": physics})
        for name, physics in (("perfect", 1e6), ("careful", 1e-6))
    }
    (folder / "old.json").write_text(stored.model_copy(update={"variants": changed}).to_json())
    options = ["--set", "time_limit_s=0.5", "--json", str(folder / "b.json"), "--plot", str(folder / "b.png")]
    grades = ["--grade", "perfect", "--grade", "careful"]
    measured: list[str] = []
    measure = speed_comparison._measured

    def noted(scene: Scene) -> TrialSpeed:
        measured.append(str(scene.as_built.grade))
        return measure(scene)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(speed_comparison, "_measured", noted)
        assert run(["bench", "close_range", *grades, *options, "--against", str(folder / "old.json")]) == 1
    assert measured == ["perfect", "perfect", "perfect", "careful"]
    return folder / "b.json"


@pytest.fixture(scope="module")
def found(written: Path) -> SpeedComparison:
    return read_comparison(written)


def test_grades_are_measured_one_after_the_other(found: SpeedComparison, written: Path) -> None:
    assert (
        [speed.as_built for speed in found.variants.values()]
        == list(found.variants)
        == ["perfect", "careful"]
    )
    assert all(speed.naive_ratio is None for speed in found.variants.values())
    assert all(speed.times_physics_alone > 1.0 for speed in found.variants.values())
    assert found.machine.endswith(" cores")
    image = cv2.imread(str(written.with_suffix(".png")))
    assert image is not None
    assert min(image.shape[:2]) > 200


def test_only_what_costs_much_more_over_physics_alone_is_slower(found: SpeedComparison) -> None:
    def faster_by(factor: float) -> SpeedComparison:
        """Return the comparison with a cheaper careful trial, on a machine half as fast."""
        speed = found.variants["careful"]
        changed = {
            "real_time_factor": 0.5 * factor * speed.real_time_factor,
            "physics_alone_ms_per_s": 2.0 * speed.physics_alone_ms_per_s,
        }
        careful = speed.model_copy(update=changed)
        return found.model_copy(update={"variants": {**found.variants, "careful": careful}})

    assert slower_than(found, found) == []
    assert slower_than(found, faster_by(0.95 * ALLOWED)) == []
    assert slower_than(faster_by(1.05 * ALLOWED), found) == []
    (line,) = slower_than(found, faster_by(1.05 * ALLOWED))
    assert line.startswith("close_range, careful: ")
    with pytest.raises(BenchError, match="nothing in common"):
        slower_than(found, found.model_copy(update={"scene": "two_units"}))


def test_many_units_build_a_line_of_the_first_of_them() -> None:
    variants = variants_of("assemble_cross", {}, ["perfect"], [2, 8])
    assert list(variants) == ["perfect, 2 units", "perfect, 8 units"]
    for scene, number in zip(variants.values(), (2, 8), strict=True):
        assert len(scene.units) == number
        assert scene.coordinated
        assert scene.shape == (ShapeSpec(line=number),)
    with pytest.raises(BenchError, match="--units 9: assemble_cross has 8 units"):
        variants_of("assemble_cross", {}, [], [9])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["cameras", "--grade", "careful"], "apply to scenes only"),
        (["close_range", "--plot", "b.png"], "expected --grade or --units"),
        (["close_range", "--grade", "careful", "--profile", "p.html"], "expected no --grade"),
        (["close_range", "--grade", "sloppy"], "found 'sloppy'"),
        (["close_range", "--grade", "careful", "--against", "none.json"], "none.json: no comparison"),
    ],
)
def test_what_does_not_go_together_is_said(
    arguments: list[str], says: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["bench", *arguments]) == 2
    assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_profile_without_its_package_says_what_to_install(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyinstrument", None)
    assert run(["bench", "close_range", "--profile", str(tmp_path / "p.html")]) == 2
    assert "msrr-bullet[profile]" in capsys.readouterr().err


@pytest.mark.nightly
def test_a_profile_names_the_functions_of_the_loop(tmp_path: Path) -> None:
    options = ["--set", "time_limit_s=0.5", "--profile", str(tmp_path / "p.html")]
    assert run(["bench", "close_range", *options]) == 0
    page = (tmp_path / "p.html").read_text()
    assert "msrr_bullet/trial/mission.py" in page
