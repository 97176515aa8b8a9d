"""The stability proofs of C1, checked along trials: where V falls, and where their assumptions do not hold.

With the corrected equations the functions of eqs. 13, 20 and 29 obey, for as long as the drive does what its
limits let through and no auxiliary state is at its clamp,

    13: V = (|z1|^2 + |z2|^2) / 2,  V' = -c1 |z1|^2 - c2 |z2|^2 + gamma_phi z1 . tanh(lambda_phi)
    20: V = |e|^2 / 2,  V' = -k_l |e|^2 - gamma_s e . tanh(lambda_s)
                           <= -(k_l - 1/4) |e|^2 + gamma_s^2 |tanh(lambda_s)|^2
    29: V = |e|^2 / 2,  V' = -k_n |e|^2 - sum exp(|e|^alpha) |e|^(2 - alpha) / (alpha T)

so that V falls wherever no wall stands and no spring pushes. Both are checked: whether V falls, and whether
it changes as the equation says (eq. 20: by no more than its inequality allows).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.studies.docking_studies import run_docking, with_paper_trajectory
from msrr_bullet.studies.model import ConditionShare, StabilityCheck
from msrr_bullet.studies.path_following_studies import OFFSET, run_path_following
from msrr_bullet.studies.settings import NO_LAG, STANDARD, Setting
from msrr_control.docking.c1 import C1DockingParams
from msrr_control.docking.corrected_law import CorrectedLawState
from msrr_control.feedback.composite import composite_feedback
from msrr_control.path_following.c1 import C1PathFollowingParams, C1PathFollowingState
from msrr_control.path_following.tracking import LEAST_K_L
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.vehicle import LimitsSpec

#: The proofs' own assumptions, and the setting of the tables.
SETTINGS = (NO_LAG, STANDARD)

#: Rate [m/s] at which V = r^2 / 2 may change r otherwise than the equations say: at 20 ms a command that is
#: held while the path accelerates by 0.15 m/s2 makes 1.5 mm/s of it. Where the rate limits bite, half a step
#: of them comes on top: the law's own limiter takes at once what the drive takes in the course of a step.
SAMPLING = 2e-3

#: Where r is smaller [m] that alone decides whether V falls: at gains about 1 1/s it keeps r at 1.2 mm.
FLOOR = 2e-3

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Descent:
    """A function V along trials, and what its proof assumes; every array has the shape (steps, trials).

    Attributes:
        value: V.
        rate: V' as the equation has it.
        dt: Step [s].
        judged: Where there is a V that is larger than the floor.
        clamped: Where an auxiliary state is at its clamp.
        limited: Where the drive's limits take something from the command.
        slack: Rate at which sqrt(2 V) may change otherwise, for sampling [m/s].
        pushed: Where a wall stands or a spring pushes.
    """

    value: Array
    rate: Array
    dt: float
    judged: Flags
    clamped: Flags
    limited: Flags
    slack: Array
    pushed: Flags

    def conditions(self) -> dict[str, ConditionShare]:
        """Return, for all time and under each condition, its share of it, and how often the proof holds."""
        change = np.diff(self.value, axis=0) / self.dt
        proved = 0.5 * (self.rate[:-1] + self.rate[1:]) + self.slack[:-1] * np.sqrt(2.0 * self.value[:-1])
        judged = self.judged[:-1] & self.judged[1:]
        clamped, limited, pushed = self.clamped[:-1], self.limited[:-1], self.pushed[:-1]
        conditions = {
            "always": np.ones_like(judged),
            "none of the following": ~(clamped | limited | pushed),
            "a state at its clamp": clamped,
            "limits bite": limited,
            "a wall or a spring": pushed,
        }
        total = max(int(judged.sum()), 1)

        def share(flags: Flags, where: Flags) -> float | None:
            return round(float(flags[where].mean()), 4) if where.any() else None

        return {
            name: ConditionShare(
                time=round(int((judged & where).sum()) / total, 4),
                falls=share(change < 0.0, judged & where),
                proved=share(change <= proved, judged & where),
            )
            for name, where in conditions.items()
        }


def stability_checks(job: tuple[Setting, range]) -> tuple[StabilityCheck, ...]:
    """Check eqs. 13, 20 and 29 in one setting, given with the seeds of the trials."""
    setting, seeds = job
    upper, lower = path_following_descents(setting, seeds)
    found = {13: upper, 20: lower, 29: docking_descent(setting, seeds)}
    return tuple(
        StabilityCheck(
            equation=equation,
            setting=setting.name,
            description=setting.description("close" if equation == 29 else "long"),
            trials=len(seeds),
            conditions=descent.conditions(),
        )
        for equation, descent in found.items()
    )


def path_following_descents(setting: Setting, seeds: range) -> tuple[Descent, Descent]:
    """Return V of the upper layer (eq. 13) and of the lower layer (eq. 20) under C1."""
    states: list[C1PathFollowingState] = []
    params = C1PathFollowingParams()
    result = run_path_following(Choice(name="c1"), setting, seeds, states.append)
    guidance, tracking = params.guidance, params.tracking
    before, after = states[:-1], states[1:]
    lam_phi, phi, rate_phi = (_stack(before, lambda s, k=k: s.guidance[k]) for k in (2, 0, 1))
    heading = np.stack([result.path.at(s.pace.s).heading for s in before])
    speed = _stack(after, lambda s: s.pace.speed)[..., None]
    rate = speed * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    z1 = phi - _stack(after, lambda s: s.desired)
    bias = guidance.windup.gamma_m * np.tanh(lam_phi)
    z2 = rate_phi - (rate - guidance.c1_per_s * z1) - bias
    wall, dt = result.walled[1:], float(result.time[1] - result.time[0])
    sum_of_squares = np.sum(z1**2 + z2**2, axis=-1)
    inner = np.abs(lam_phi) >= guidance.windup.clamp - 1e-9
    upper = Descent(
        value=0.5 * sum_of_squares,
        rate=np.sum(bias * z1 - guidance.c1_per_s * z1**2 - guidance.c2_per_s * z2**2, axis=-1),
        dt=dt,
        judged=np.sqrt(sum_of_squares) > FLOOR,
        clamped=_either(inner),
        limited=np.zeros_like(wall),
        slack=np.full(wall.shape, SAMPLING),
        pushed=wall,
    )
    lam, lam_s = (_stack(before, lambda s, k=k: s.tracking[k]) for k in (0, 1))
    error = result.tip[1:] - _stack(after, lambda s: s.guidance.position)
    error -= tracking.windup.gamma_m * np.tanh(lam)
    limited = _stack(after, lambda s: s.tracking.limited)
    limits = setting.scene.limits
    most = np.array([limits.v_max_mps, limits.w_max_radps])
    bite = _limits_bite(result.command[1:], limited, most)
    clamp = np.abs(lam) >= tracking.windup.clamp - 1e-9
    clamp |= np.abs(lam_s) >= tracking.spring.windup.clamp - 1e-9
    pushed = tracking.spring.windup.gamma_m * np.tanh(lam_s)
    lower = Descent(
        value=0.5 * np.sum(error**2, axis=-1),
        rate=np.sum(pushed**2 - (tracking.k_l_per_s - LEAST_K_L) * error**2, axis=-1),
        dt=dt,
        judged=np.hypot(error[..., 0], error[..., 1]) > FLOOR,
        clamped=_either(clamp),
        limited=bite,
        slack=_slack(bite, limits, dt),
        pushed=_either(np.abs(lam_s) > 1e-9),
    )
    return upper, lower


def docking_descent(setting: Setting, seeds: range) -> Descent:
    """Return V of the close phase (eq. 29) under C1 on the paper's trajectory, from start to contact."""
    states: list[CorrectedLawState] = []
    params = C1DockingParams()
    result = run_docking(with_paper_trajectory(Choice(name="c1")), setting, seeds, observer=states.append)
    before, after = states[:-1], states[1:]
    xi = _stack(before, lambda s: s.xi)
    goal = result.reference[1:] + _stack(after, lambda s: s.cone.shift)
    error = result.tip[1:] - goal - params.windup.gamma_m * np.tanh(xi)
    steps = 1 + np.arange(len(after))[:, None]
    under_way = steps <= np.where(result.at_face, result.contact, len(states))
    limits = setting.scene.limits
    most = np.array([limits.v_close_mps, limits.w_max_radps])
    bite = _limits_bite(result.command[1:], _stack(after, lambda s: s.limited), most)
    return Descent(
        value=0.5 * np.sum(error**2, axis=-1),
        rate=np.sum(error * composite_feedback(error, params.feedback), axis=-1),
        dt=result.dt,
        judged=(np.hypot(error[..., 0], error[..., 1]) > FLOOR) & under_way,
        clamped=_either(np.abs(xi) >= params.windup.clamp - 1e-9),
        limited=bite,
        slack=_slack(bite, limits, result.dt),
        pushed=np.zeros_like(under_way),
    )


def _limits_bite(command: Array, limited: Array, most: Array) -> Flags:
    """Say where the law's own limiter, which has no lag, lets less through than is wished."""
    return _either((np.abs(command) >= most) | (np.abs(limited - command) > 1e-9))


def _either(flags: Flags) -> Flags:
    """Return what is true along either axis, (steps, trials, 2) to (steps, trials)."""
    return flags[..., 0] | flags[..., 1]


def _slack(bite: Flags, limits: LimitsSpec, dt: float) -> Array:
    """Return the slack where limits bite and elsewhere; the unit's controlled point is 0.1 m ahead [m/s]."""
    half_a_step = 0.5 * dt * (limits.a_max_mps2 + OFFSET * limits.dw_max_radps2)
    return np.where(bite, SAMPLING + half_a_step, SAMPLING)


def _stack(states: list[Any], part: Any) -> Array:
    return np.stack([part(state) for state in states])
