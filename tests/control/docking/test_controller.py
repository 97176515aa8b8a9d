import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_control.docking.controller import (
    CONTROLLERS,
    ControlInputs,
    LawController,
    build_controller,
    law_inputs,
    promised_speed,
)
from msrr_control.docking.law import DockSetup
from msrr_scenes.errors import ProgramFailedError, SceneError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LosObservation, LosStatus, PoseEstimate, Twist
from msrr_scenes.specs.spec import Choice


def _inputs(x=-0.8, y=0.05, yaw=0.2, status=LosStatus.SEEN, now_ns=0) -> ControlInputs:
    pose = PoseEstimate(now_ns, SE2(x, y, yaw), 1e-6 * np.eye(3), now_ns)
    return ControlInputs(now_ns, 0.02, pose, LosObservation(now_ns, 0.1, -0.1, 0.5, status))


class Crawler:
    """A controller of a user's own."""

    def __init__(self, setup: DockSetup, speed_mps: float = 0.02) -> None:
        self.speed = speed_mps

    def reset(self, inputs: ControlInputs) -> None:
        pass

    def step(self, inputs: ControlInputs) -> Twist:
        return Twist(self.speed, -inputs.pose.X_DU.yaw)


class Half:
    def __init__(self, setup: DockSetup) -> None:
        pass

    def reset(self, inputs: ControlInputs) -> None:
        pass


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_every_shipped_controller_drives_towards_the_port(facts: DockSetup, name: str) -> None:
    controller = build_controller(Choice(name=name), facts)
    controller.reset(_inputs())
    for _ in range(50):
        twist = controller.step(_inputs())
    assert 0.0 < twist.v <= facts.limits.v_close_mps
    assert -facts.limits.w_max_radps <= twist.w < 0.0


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_a_reset_forgets_everything(facts: DockSetup, name: str) -> None:
    used, fresh = (build_controller(Choice(name=name), facts) for _ in range(2))
    used.reset(_inputs(y=-0.1))
    for _ in range(30):
        used.step(_inputs(y=-0.1))
    used.reset(_inputs())
    fresh.reset(_inputs())
    assert [used.step(_inputs()) for _ in range(5)] == [fresh.step(_inputs()) for _ in range(5)]


@pytest.mark.parametrize(
    ("status", "visibility"), [(LosStatus.SEEN, 1.0), (LosStatus.PREDICTED, 0.5), (LosStatus.LOST, 0.0)]
)
def test_the_less_is_seen_the_slower_is_the_guidance(status: LosStatus, visibility: float) -> None:
    arrays = law_inputs(_inputs(status=status))
    assert (float(arrays.visibility), arrays.edges.tolist()) == (visibility, [0.1, -0.1])
    for edges in ((math.nan, -0.1), (0.1, math.nan), (math.nan, math.nan)):
        los = LosObservation(0, *edges, math.nan, status)
        blind = law_inputs(replace(_inputs(), los=los))
        assert (float(blind.visibility), blind.edges.tolist()) == (0.0, [0.0, 0.0])
    assert float(law_inputs(replace(_inputs(), los=None)).visibility) == 0.0


def test_a_first_step_without_reset_begins_an_approach(facts: DockSetup) -> None:
    a, b = (build_controller(Choice(name="c1"), facts) for _ in range(2))
    b.reset(_inputs())
    assert a.step(_inputs()) == b.step(_inputs())


def test_a_controller_by_import_path(facts: DockSetup, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys
    import types

    module = types.ModuleType("users_own")
    module.Crawler, module.Half = Crawler, Half
    monkeypatch.setitem(sys.modules, "users_own", module)
    controller = build_controller(Choice(name="users_own:Crawler", params={"speed_mps": 0.04}), facts)
    assert controller.step(_inputs()) == Twist(0.04, -0.2)
    with pytest.raises(SceneError, match="no method step"):
        build_controller(Choice(name="users_own:Half"), facts)
    with pytest.raises(SceneError, match="does not take"):
        build_controller(Choice(name="users_own:Crawler", params={"sped": 1.0}), facts)


class Promising(Crawler):
    approach_mps: object = 0.05


@pytest.mark.parametrize(("promised", "speed"), [(0.05, 0.05), (None, 0.0)])
def test_one_s_own_controller_may_promise_a_speed(
    facts: DockSetup, monkeypatch: pytest.MonkeyPatch, promised: float | None, speed: float
) -> None:
    monkeypatch.setattr(Promising, "approach_mps", promised)
    built = build_controller(Choice(name=f"{__name__}:Promising"), facts)
    assert promised_speed(built, facts.limits) == speed
    assert promised_speed(build_controller(Choice(name=f"{__name__}:Crawler"), facts), facts.limits) == 0.0


def test_no_more_is_promised_than_the_drive_may_go(facts: DockSetup) -> None:
    slow = facts.limits.model_copy(update={"v_close_mps": 0.01})
    for name in ("c1", "c2", "linear"):
        law = build_controller(Choice(name=name), facts)
        assert promised_speed(law, facts.limits) > promised_speed(law, slow) == 0.01


def test_a_promise_has_to_be_a_speed(facts: DockSetup, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Promising, "approach_mps", "fast")
    with pytest.raises(ProgramFailedError, match="approach_mps returned 'fast'; expected a speed"):
        promised_speed(build_controller(Choice(name=f"{__name__}:Promising"), facts), facts.limits)


class _TwoRows:
    """An array law that returns the commands of two robots."""

    def start(self, inputs: object) -> None:
        return None

    def step(self, state: None, inputs: object, dt: float) -> tuple[np.ndarray, None]:
        return np.zeros((2, 2)), None


def test_a_law_that_commands_more_than_one_robot_is_named() -> None:
    with pytest.raises(ValueError, match=r"_TwoRows\.step returned a command of shape \(2, 2\)"):
        LawController(_TwoRows()).step(_inputs())


class _Pair:
    """An array law that returns its command as a pair of numbers."""

    def start(self, inputs: object) -> None:
        return None

    def step(self, state: None, inputs: object, dt: float) -> tuple[tuple[float, float], None]:
        return (0.1, -0.2), None


def test_a_law_may_return_a_pair_of_numbers() -> None:
    assert LawController(_Pair()).step(_inputs()) == Twist(0.1, -0.2)


@pytest.mark.parametrize(
    "result", [None, (0.1, 0.0), Twist(math.inf, 0.0), Twist(0.1, math.nan), Twist("fast", 0.0), Twist(1j, 0)]
)
def test_a_command_of_one_s_own_controller_is_a_finite_twist(result: object) -> None:
    """A tuple ended in a traceback, a NaN in one that asked to be reported."""
    with pytest.raises(ValueError, match="expected a Twist"):
        CONTROLLERS.methods["step"](result)
    plain = CONTROLLERS.methods["step"](Twist(np.float32(0.5), 0))
    assert (type(plain.v), plain) == (float, Twist(0.5, 0.0))


def test_an_unknown_name_is_answered_with_the_nearest(facts: DockSetup) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'linear'"):
        build_controller(Choice(name="lineer"), facts)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"feedback": {"k_n_per_s": -1.0}}, r"feedback\.k_n_per_s: .*greater than or equal to 0.001"),
        ({"feedbak": {}}, r"feedbak.*did you mean 'feedback'"),
        ({"feedback": {"alpah": 0.3}}, r"feedback\.alpah.*did you mean 'alpha'"),
        ({"windup": {"k_mps": 1.0, "gamma_m": 0.1}}, "limit cycle"),
        ({"guidance": {"speed_mps": math.nan}}, r"guidance\.speed_mps"),
    ],
)
def test_bad_parameters_are_one_message(facts: DockSetup, params, message) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        build_controller(Choice(name="c1", params=params), facts)
    assert "\n" not in str(caught.value)
    assert "errors.pydantic.dev" not in str(caught.value)


def test_a_law_is_told_how_old_its_inputs_are() -> None:
    """Without delay compensation an estimate is of the last exposure, and is stamped with its time."""
    late = ControlInputs(120_000_000, 0.02, _inputs(now_ns=20_000_000).pose, None)
    assert law_inputs(late).age == pytest.approx(0.1)
    assert law_inputs(_inputs(now_ns=20_000_000)).age == 0.0


def test_a_step_is_fast(facts: DockSetup, cost_s) -> None:
    controller = build_controller(Choice(name="c1"), facts)
    inputs = _inputs()
    controller.reset(inputs)
    assert cost_s(lambda: controller.step(inputs)) < 2e-4
