"""The trials of a sweep as a table."""

import csv

from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.trial_table import TRIAL_COLUMNS, trials_csv
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import AssemblyFigures, PlanarPose
from msrr_scenes import scene_hash
from msrr_scenes.specs.scene import Scene
from tests.bullet.sweep.conftest import made_up


def _rows(*outcomes: TrialResult | TrialFailure) -> list[dict[str, str]]:
    return list(csv.DictReader(trials_csv(outcomes).splitlines(), strict=True))


def test_every_step_has_a_row_with_the_bits_of_its_result(scene: Scene) -> None:
    result = made_up(scene, 3)
    (step,) = result.steps
    contact = step.contact
    assert contact is not None
    error = PlanarPose(x_m=1.0, y_m=-0.1 / 3.0, yaw_rad=0.02)
    last = step.attempts[-1].model_copy(
        update={"contact": contact.model_copy(update={"estimate_error": error})}
    )
    figures = AssemblyFigures(tracking_error_m=0.01, recovery_s=2.5)
    first = step.model_copy(update={"attempts": (*step.attempts[:-1], last), "assembly": figures})
    later = step.model_copy(update={"index": 1, "undocks": True, "pull_test_passed": False})
    rows = _rows(result.model_copy(update={"steps": (first, later)}))
    assert {r["scene"] for r in rows} == {"close_range"}
    assert [(r["seed"], r["step"], r["undocks"], r["attempts"]) for r in rows] == [
        ("3", "0", "0", "2"),
        ("3", "1", "1", "2"),
    ]
    row = rows[0]
    assert (row["plant"], row["perception"]) == (result.plant, result.perception)
    assert (row["as_built"], row["scene_hash"]) == (result.as_built, result.scene_hash)
    assert float(row["contact_lateral_m"]) == contact.lateral_m
    signed = float(row["contact_y_m"]), float(row["contact_heading_rad"])
    assert signed == (contact.port.y_m, contact.port.yaw_rad)
    assert float(row["contact_estimate_error_y_m"]) == error.y_m
    assert (row["tracking_error_m"], row["amplitude_m"], row["recovery_s"]) == ("0.01", "", "2.5")
    assert (row["pull_test_passed"], rows[1]["pull_test_passed"]) == ("", "0")
    assert (rows[1]["contact_estimate_error_y_m"], rows[1]["recovery_s"]) == ("", "")


def test_a_trial_without_a_step_or_a_result_has_one_row(scene: Scene) -> None:
    empty = made_up(scene, 1).model_copy(update={"steps": ()})
    died, nothing = _rows(
        TrialFailure(scene=scene.name, scene_hash=scene_hash(scene), seed=7, error='died, "so it says"'),
        empty,
    )
    assert (died["scene"], died["seed"]) == (scene.name, "7")
    assert (died["outcome"], died["reason"]) == ("", 'died, "so it says"')
    assert (nothing["seed"], nothing["outcome"], nothing["step"]) == ("1", "docked", "")
    assert set(died) == set(nothing) == {column.name for column in TRIAL_COLUMNS}


def test_without_trials_there_is_a_header() -> None:
    assert trials_csv([]).splitlines() == [",".join(column.name for column in TRIAL_COLUMNS)]
