"""Check of a robot against its motors: they accelerate it as the limits of the drive promise.

Controllers and the collision monitor count on these limits, by which units brake as well. A trial does not
say so in words: one of a robot of 4000 kg ended as a false abort.
"""

from __future__ import annotations

from collections.abc import Iterator

from msrr_scenes.geometry.inertial import Inertial, whole_inertial
from msrr_scenes.specs.scene import Scene


def drive_problems(scene: Scene, unit: str) -> Iterator[str]:
    """Yield why the motors of a unit that drives are too weak for it, in words.

    A scene that says by itself how strong its motors are is taken at its word: weak ones are a fault that can
    be tried. Others have motors for a robot like the shipped one.
    """
    drives = scene.shape is not None or any(step.unit == unit for step in scene.plan)
    if not drives or "torque_nm" in scene.motors.model_fields_set:
        return
    geometry, limits = scene.geometry(unit), scene.limits
    tree = geometry.link_tree
    whole = whole_inertial(tree)
    wheel_n = scene.motors.torque_nm / geometry.wheel_radius
    # By an upper bound of the accelerations: the turning of the wheels takes torque as well.
    forward = 2.0 * wheel_n / whole.mass
    turning = wheel_n * geometry.track / float(whole.inertia_about(tree.frames["axle"].p)[2, 2])
    found, promised, key, unit_of = forward, limits.a_max_mps2, "a_max_mps2", "m/s^2"
    if forward >= promised:
        found, promised, key, unit_of = turning, limits.dw_max_radps2, "dw_max_radps2", "rad/s^2"
    if found >= promised:
        return
    masses = {name: Inertial.of(link.find("inertial")).mass for name, link in tree.links.items()}
    heaviest = max(masses, key=lambda name: masses[name])
    named = {frame.name: frame.link for frame in geometry.frame_map}.get(heaviest, heaviest)
    yield (
        f"it weighs {whole.mass:.4g} kg, {masses[heaviest]:.4g} kg of it link {named!r}. Motors of "
        f"{scene.motors.torque_nm:g} N m on wheels of {1e3 * geometry.wheel_radius:.3g} mm accelerate it by "
        f"{found:.3g} {unit_of}, and limits.{key} promises {promised:g}. A <mass> is in kg and an <inertia> "
        f"in kg m^2; say in motors.torque_nm how strong the motors are, or lower limits.{key}"
    )
