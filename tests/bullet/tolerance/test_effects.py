"""Effects: each changes one thing that no robot is told, up to what the scene accepts."""

import pytest
from pydantic import ValidationError

from msrr_bullet.tolerance.camera_response import RESPONSES
from msrr_bullet.tolerance.effects import (
    RANGE,
    Effect,
    as_designed_scene,
    effects_of,
    nearly_the_same,
    select_effects,
)
from msrr_scenes import load_scene
from msrr_scenes.as_built import draw_as_built
from msrr_scenes.errors import SceneError, UnknownNameError
from msrr_scenes.loading.load import check_scene
from msrr_scenes.specs.scene import Scene


@pytest.fixture(scope="module")
def seen() -> Scene:
    """A scene with contact and pixels, in which robots are told the tolerances of a grade."""
    return load_scene("close_range", {"as_built": "careful"})


@pytest.fixture(scope="module")
def acting(seen: Scene) -> tuple[Effect, ...]:
    return effects_of(seen)


def test_without_an_effect_everything_is_as_designed_and_the_tolerances_are_told(seen: Scene) -> None:
    base = as_designed_scene(seen)
    assert set(draw_as_built(base, 3).errors.values()) == {0.0}
    assert base.told().as_built == seen.told().as_built
    assert base.cameras == load_scene("close_range", {"as_built": "perfect"}).cameras


def test_every_quantity_that_acts_is_an_effect(seen: Scene, acting: tuple[Effect, ...], scene: Scene) -> None:
    names = {effect.name for effect in acting}
    deviations = {f"{group}.{quantity}" for group, quantity, _ in seen.as_built.deviations()}
    expected = {name for name in deviations if not name.startswith("overhead.")}
    assert names == expected | {f"cameras.onboard.{key}" for key in RESPONSES}
    without_floor_and_pixels = {effect.name for effect in effects_of(scene)}
    assert names - without_floor_and_pixels == {
        name for name in names if name.startswith(("floor.", "cameras.")) or name == "body.mass_percent"
    }


def test_an_effect_changes_one_error_and_nothing_that_is_told(
    seen: Scene, acting: tuple[Effect, ...]
) -> None:
    base = as_designed_scene(seen)
    for effect in acting:
        changed = effect.apply(base, effect.signs[-1] * effect.step)
        check_scene(changed)
        if effect.name.startswith("cameras."):
            assert draw_as_built(changed, 3).errors == draw_as_built(base, 3).errors
            assert changed.cameras != base.cameras
            continue
        assert effect.drawn or changed.told() == base.told(), effect.name
        errors = {name: error for name, error in draw_as_built(changed, 3).errors.items() if error}
        group, quantity = effect.name.split(".")
        assert errors
        assert {name.rpartition("/")[2] for name in errors} == {quantity}
        assert all(group in name for name in errors if group in ("onboard", "bracket", "drive", "tags"))
        if effect.drawn:
            assert len(set(errors.values())) > 5  # every tag has its own
        elif quantity != "friction_percent":
            assert set(errors.values()) == {effect.signs[-1] * effect.step}


def test_the_largest_size_is_accepted_and_a_larger_one_is_not(
    seen: Scene, acting: tuple[Effect, ...]
) -> None:
    base = as_designed_scene(seen)
    limited = [effect for effect in acting if effect.top < RANGE * effect.step]
    assert {"onboard.k1", "cameras.onboard.exposure_ms"} <= {effect.name for effect in limited}
    for effect in limited:
        for sign in effect.signs:
            check_scene(effect.apply(base, sign * effect.top))
        refused = []
        for sign in effect.signs:
            try:
                check_scene(effect.apply(base, sign * (1.08 * effect.top)))
            except (ValidationError, SceneError) as error:
                refused.append(error)
        assert refused, effect.name


def test_one_sigma_of_slippery_floor_is_what_a_grade_draws(seen: Scene, acting: tuple[Effect, ...]) -> None:
    (friction,) = select_effects(acting, ["floor.friction_percent"])
    built = draw_as_built(friction.apply(as_designed_scene(seen), friction.step), 0)
    assert built.floor.friction_scale == pytest.approx(0.6065, abs=1e-4)


def test_effects_are_selected_by_name_and_by_group(acting: tuple[Effect, ...]) -> None:
    chosen = select_effects(acting, ["floor", "onboard.yaw_deg", "floor.ridge_m"])
    names = [effect.name for effect in chosen]
    assert names[0] == "onboard.yaw_deg"
    assert len(names) == len(set(names)) == 5
    assert all(e.name.startswith("cameras.onboard.") for e in select_effects(acting, ["cameras"]))
    with pytest.raises(UnknownNameError, match=r"'onboard\.yaw'; did you mean 'onboard\.yaw_deg'\?"):
        select_effects(acting, ["onboard.yaw"])


@pytest.mark.parametrize("grade", ["perfect", "careful"])
def test_while_an_effect_is_alone_the_encoders_are_those_of_the_scene(grade: str) -> None:
    """They were 2 % wrong, as in the grade perfect alone, and an error of a wheel pushed the robot aside."""
    scene = load_scene("close_range", {"as_built": grade})
    base = as_designed_scene(scene)
    assert base.odometry == scene.odometry
    assert base.odometry.scale_error == (0.02 if grade == "perfect" else 0.0)
    near = nearly_the_same(base).as_built.drive.radius_left_percent.error
    assert near is not None
    assert 0.0 < near < 0.01
