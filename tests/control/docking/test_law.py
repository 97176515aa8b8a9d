"""Laws that every docking law obeys, whatever it does."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.docking.barrier import BarrierLaw, BarrierParams
from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams, LinearParams
from msrr_control.docking.c2 import C2DockingLaw, C2DockingParams
from msrr_control.docking.controller import CONTROLLERS, LawController
from msrr_control.docking.graceful import GracefulLaw, GracefulParams
from msrr_control.docking.law import DockingLaw, DockSetup, LawInputs
from msrr_control.studies.disturbance import Disturbance
from msrr_control.studies.docking_study import CLOSE, run_docking_study
from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.vehicle import LimitsSpec

FACTS = DockSetup(0.1, 0.02, 0.018, 0.015, (0.04, -0.04), LosSpec(), LimitsSpec.model_validate({}), 50.0)
LAWS = {
    "c1": C1DockingLaw(C1DockingParams(), FACTS),
    "c2": C2DockingLaw(C2DockingParams(), FACTS),
    "linear": C1DockingLaw(LinearParams().as_c1(), FACTS),
    "cbf": BarrierLaw(BarrierParams(), FACTS),
    "graceful": GracefulLaw(GracefulParams(), FACTS),
}
FINITE = st.floats(-1e300, 1e300)
MIRROR = np.array([1.0, -1.0])

every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())


def _random(rng: np.random.Generator, trials: int) -> LawInputs:
    pose = rng.uniform([-0.9, -0.2, -0.6], [-0.1, 0.2, 0.6], size=(trials, 3))
    edges = rng.uniform(-0.6, 0.6, size=(trials, 2))
    visibility, twist = rng.choice([0.0, 0.5, 1.0], size=trials), rng.normal(size=(trials, 2))
    return LawInputs(pose, edges, visibility, twist, np.linspace(0.0, 0.15, trials))


def _mirrored(inputs: LawInputs) -> LawInputs:
    return LawInputs(
        inputs.pose * [1.0, -1.0, -1.0],
        -inputs.edges[..., ::-1],
        inputs.visibility,
        inputs.twist * MIRROR,
        inputs.age,
    )


@every_law
def test_the_mirrored_input_gives_the_mirrored_command(law: DockingLaw) -> None:
    rng = np.random.default_rng(11)
    inputs = _random(rng, 500)
    state, mirrored_state = law.start(inputs), law.start(_mirrored(inputs))
    for _ in range(50):
        command, state = law.step(state, inputs, 0.02)
        mirrored, mirrored_state = law.step(mirrored_state, _mirrored(inputs), 0.02)
        np.testing.assert_allclose(mirrored, command * MIRROR, atol=1e-12)
        inputs = _random(rng, 500)


@every_law
@settings(max_examples=60, deadline=None)
@given(
    st.tuples(FINITE, FINITE, FINITE),
    st.tuples(FINITE, FINITE),
    st.tuples(FINITE, FINITE),
    st.floats(0.0, 1.0),
    st.floats(1e-4, 10.0),
)
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_any_finite_input_gives_a_command_within_limits(law, pose, edges, twist, visibility, dt) -> None:
    inputs = LawInputs(np.array(pose), np.array(edges), np.array(visibility), np.array(twist))
    state = law.start(inputs)
    for _ in range(3):
        command, state = law.step(state, inputs, dt)
        assert np.all(np.isfinite(command))
        assert abs(command[0]) <= FACTS.limits.v_close_mps
        assert abs(command[1]) <= FACTS.limits.w_max_radps
        assert all(np.all(np.isfinite(a)) for a in _leaves(state))


@every_law
def test_noisy_starts_dock_within_the_capture_of_the_funnel(law: DockingLaw) -> None:
    """13 mm and 8 deg is what the mechanism centres; 300 trials at 5 mm, 1 deg, 50 ms."""
    noise = Disturbance(sigma_xy_m=0.005, sigma_yaw_deg=1.0, sigma_bearing_deg=0.1, delay_s=0.05)
    result = run_docking_study(law, FACTS, np.random.default_rng(3), 300, CLOSE, noise)
    lateral, yaw = result.at_contact()
    assert result.at_face.all()
    assert np.abs(lateral).max() < 0.010
    assert np.degrees(np.abs(yaw)).max() < 5.0


def _leaves(state):
    for part in state:
        if isinstance(part, tuple):
            yield from _leaves(part)
        else:
            yield part


TRIALS, DT = 40, 0.02


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_a_docking_law_drives_one_robot_as_it_drives_many(name: str, facts: DockSetup) -> None:
    """40 random approaches, seen, predicted and lost: 60 steps, every bit."""
    rng = np.random.default_rng(4)
    controller = CONTROLLERS[name](facts)
    assert isinstance(controller, LawController)
    law = controller.law
    pose = np.column_stack(
        [rng.uniform(-0.8, -0.15, TRIALS), rng.normal(0.0, 0.05, TRIALS), rng.normal(0.0, 0.2, TRIALS)]
    )

    def inputs(rows: slice | int) -> LawInputs:
        return LawInputs(pose[rows], edges[rows], np.asarray(visibility[rows]), twist[rows], age[rows])

    twist, age = rng.normal(0.0, 0.2, (TRIALS, 2)), np.linspace(0.0, 0.15, TRIALS)
    edges = rng.normal(0.0, 0.3, (TRIALS, 2))
    visibility = rng.choice([0.0, 0.5, 1.0], TRIALS)
    many = law.start(inputs(slice(None)))
    ones = [law.start(inputs(i)) for i in range(TRIALS)]
    for _ in range(60):
        edges, visibility = rng.normal(0.0, 0.3, (TRIALS, 2)), rng.choice([0.0, 0.5, 1.0], TRIALS)
        twist = rng.normal(0.0, 0.2, (TRIALS, 2))
        commands, many = law.step(many, inputs(slice(None)), DT)
        for i in range(TRIALS):
            command, ones[i] = law.step(ones[i], inputs(i), DT)
            assert (command == commands[i]).all()
        heading = np.column_stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])])
        pose = pose + DT * np.column_stack([heading * commands[:, :1], commands[:, 1]])
    assert np.abs(commands).max() > 0.01


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"offset": -0.1}, "ahead of the axle"),
        ({"camera_offset": 0.2}, "beyond the line-of-sight target"),
        ({"los": LosSpec(half_width_m=0.06)}, "park short"),
    ],
)
def test_a_geometry_that_cannot_work_is_refused(changes, message) -> None:
    values = {"offset": 0.1, "camera_offset": 0.0, "pin_reach": 0.018, "mouth": 0.015, "los": LosSpec()}
    values["pins"] = FACTS.pins
    with pytest.raises(SceneError, match=message):
        DockSetup(**{**values, **changes}, limits=FACTS.limits, rate_hz=50.0)


def test_a_camera_ahead_of_the_axle_sees_the_edges_under_larger_angles_at_contact() -> None:
    """44.1 mm to the side and 44.2 mm behind the face: 20 deg from 121 mm, 23 mm ahead of the axle."""
    values = {
        "offset": 0.1,
        "pin_reach": 0.018,
        "mouth": 0.015,
        "pins": FACTS.pins,
        "los": LosSpec(),
        "limits": FACTS.limits,
        "rate_hz": 50.0,
    }
    assert DockSetup(camera_offset=0.022, **values).camera_offset == 0.022
    assert DockSetup(camera_offset=-0.5, **values).camera_offset == -0.5
    with pytest.raises(SceneError, match=r"sees the target's edges at 20\.1 deg, not inside"):
        DockSetup(camera_offset=0.024, **values)


def test_the_facts_of_a_step_are_those_of_the_unit_and_of_the_scene() -> None:
    units = {name: {"number": i} for i, name in enumerate("ab")}
    plan = [{"unit": "a", "to": "b.rear"}]
    link = {"latency_ms": 30.0}
    scene = Scene.model_validate({"name": "pair", "units": units, "plan": plan, "link": link})
    facts = DockSetup.of(scene, scene.docks[0])
    assert (facts.offset, facts.camera_offset) == pytest.approx((0.1, 0.0))
    assert (facts.pin_reach, facts.mouth) == pytest.approx((0.018, 0.015), abs=1e-6)
    assert (facts.link_latency_s, facts.rate_hz) == (0.03, scene.control.rate_hz)
    assert (facts.los, facts.limits) == (scene.los, scene.limits)


@pytest.mark.parametrize("gap", [0.05, 0.3, 0.8])
def test_a_tag_moves_by_one_module_in_an_exposure_at_the_turn_rate_up_to_which_it_is_read(gap: float) -> None:
    """A camera that turns on the spot sees a tag pass at its distance times the turn rate."""
    scene = load_scene("close_range", {"cameras.onboard.exposure_ms": 40})
    setup = DockSetup.of(scene, scene.docks[0])
    distance = gap + setup.offset - setup.camera_offset + setup.los.setback_m
    module_m = 0.05 / 8  # of the large tags of a port
    assert 0.040 * setup.readable_turn(gap) * distance == pytest.approx(module_m)
    assert setup.readable_turn(-gap) == setup.readable_turn(0.0) > setup.readable_turn(gap)


@pytest.mark.parametrize(
    "changes", [{"as_built": "perfect"}, {"perception": "parametric"}], ids=["an instant", "no pixels"]
)
def test_what_is_not_smeared_is_read_at_any_turn_rate(changes: dict[str, str]) -> None:
    scene = load_scene("close_range", changes)
    assert DockSetup.of(scene, scene.docks[0]).readable_turn(0.5) == math.inf
