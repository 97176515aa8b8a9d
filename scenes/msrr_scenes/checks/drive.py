"""Check of a robot against its motors: they accelerate it as the limits of the drive promise.

Controllers and the collision monitor count on these limits, by which units brake as well. A trial does not
say so in words: one of a robot of 4000 kg ended as a false abort.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from msrr_scenes.geometry.inertial import Inertial, whole_inertial
from msrr_scenes.geometry.urdf_tree import LinkTree, one_number
from msrr_scenes.specs.scene import Scene


class _Shortfall(NamedTuple):
    """An acceleration that motors do not reach [m/s^2 or rad/s^2], and the limit that promises it."""

    found: float
    promised: float
    key: str
    unit: str


def drive_problems(scene: Scene, unit: str) -> Iterator[str]:
    """Yield why the motors of a unit that drives are too weak for it, in words.

    A scene that says by itself how strong its motors are is taken at its word: weak ones are a fault that can
    be tried. Others have motors for a robot like the shipped one. Losses that the URDF draws are no such
    fault.
    """
    if scene.shape is None and all(step.unit != unit for step in scene.plan):
        return
    geometry, torque = scene.geometry(unit), scene.motors.torque_nm
    weak = _shortfall(scene, unit, torque)
    if weak is not None:
        if "torque_nm" not in scene.motors.model_fields_set:
            yield _too_heavy(scene, unit, weak)
        return
    damping = max(_damping(geometry.link_tree, wheel) for wheel in ("wheel_left", "wheel_right"))
    lost = damping * scene.limits.v_max_mps / geometry.wheel_radius
    weak = _shortfall(scene, unit, torque - lost)
    if weak is not None:
        yield (
            f"<dynamics> of its wheels has a damping of {damping:g} N m s/rad, which takes {lost:.3g} N m "
            f"of the {torque:g} N m of a motor at limits.v_max_mps {scene.limits.v_max_mps:g}. What is left "
            f"accelerates it by {max(weak.found, 0.0):.3g} {weak.unit}, and limits.{weak.key} promises "
            f"{weak.promised:g}; lower the damping or the limits, or say in motors.torque_nm how strong the "
            "motors are"
        )


def _shortfall(scene: Scene, unit: str, torque: float) -> _Shortfall | None:
    """Return the acceleration that wheels with this torque [N m] do not reach; None if they reach all.

    By an upper bound of the accelerations: the turning of the wheels takes torque as well.
    """
    geometry, limits = scene.geometry(unit), scene.limits
    whole, wheel_n = whole_inertial(geometry.link_tree), torque / geometry.wheel_radius
    forward = 2.0 * wheel_n / whole.mass
    if forward < limits.a_max_mps2:
        return _Shortfall(forward, limits.a_max_mps2, "a_max_mps2", "m/s^2")
    axle = geometry.link_tree.frames["axle"].p
    turning = wheel_n * geometry.track / float(whole.inertia_about(axle)[2, 2])
    if turning < limits.dw_max_radps2:
        return _Shortfall(turning, limits.dw_max_radps2, "dw_max_radps2", "rad/s^2")
    return None


def _too_heavy(scene: Scene, unit: str, weak: _Shortfall) -> str:
    geometry = scene.geometry(unit)
    links = geometry.link_tree.links
    masses = {name: Inertial.of(link.find("inertial")).mass for name, link in links.items()}
    heaviest = max(masses, key=lambda name: masses[name])
    return (
        f"it weighs {whole_inertial(geometry.link_tree).mass:.4g} kg, {masses[heaviest]:.4g} kg of it link "
        f"{geometry.name_in_urdf(heaviest)!r}. Motors of {scene.motors.torque_nm:g} N m on wheels of "
        f"{1e3 * geometry.wheel_radius:.3g} mm accelerate it by {weak.found:.3g} {weak.unit}, and "
        f"limits.{weak.key} promises {weak.promised:g}. A <mass> is in kg and an <inertia> in kg m^2; say in "
        f"motors.torque_nm how strong the motors are, or lower limits.{weak.key}"
    )


def _damping(tree: LinkTree, wheel: str) -> float:
    """Return the damping of the joint of a wheel [N m s/rad], which PyBullet has act on it."""
    dynamics = tree.joints[wheel].find("dynamics")
    return 0.0 if dynamics is None else one_number(dynamics, "damping")
