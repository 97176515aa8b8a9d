"""The auxiliary (anti-windup) system of the paper, stepped so that no step size makes it diverge."""

from __future__ import annotations

from functools import lru_cache

from pydantic import Field

from msrr_control.kinematics.elementwise import Number, limit, tanh
from msrr_scenes.specs.spec import Length, Spec, Speed

#: Newton's method starts short of the root of a function that is concave there, so it climbs monotonically;
#: with the clamp below 2 six iterations reach rounding error.
_ITERATIONS = 6


class AuxiliaryGains(Spec):
    """Gains of one auxiliary system.

    Attributes:
        k_mps: Decay k of the state [m/s] (m/s2 in the upper layer of the long-distance phase).
        gamma_m: Scale gamma of its contribution gamma tanh(lambda) [m] (m/s in that layer).
        clamp: Largest |lambda|; beyond it the state can escape in finite time.
    """

    k_mps: Speed
    gamma_m: Length
    clamp: float = Field(default=1.5, gt=0.0, le=2.0)

    @property
    def bandwidth(self) -> float:
        """Ratio k / gamma [1/s]."""
        return self.k_mps / self.gamma_m

    def check_below(self, gain: float, name: str) -> None:
        """Refuse a bandwidth above the gain of the position loop [1/s], which makes a limit cycle.

        Raises:
            ValueError: It is; the message says so with ``name``, the name of that gain.
        """
        if self.bandwidth >= gain:
            raise ValueError(
                f"windup.k_mps / windup.gamma_m = {self.bandwidth:.3g} 1/s has to stay below {name} ="
                f" {gain:.3g} 1/s; else anti-windup is a limit cycle"
            )


def auxiliary_step(state: Number, excess: Number, gains: AuxiliaryGains, dt: float) -> Number:
    r"""Advance the auxiliary state by one implicit step.

    .. math:: \dot\lambda = \cosh^2(\lambda)\,(-k\lambda + \Delta)/\gamma

    Written for sigma = gamma tanh(lambda) this is sigma' = -k lambda + Delta, which the backward Euler rule
    turns into ``gamma tanh L + dt k L = sigma + dt Delta`` with one root L. The right side is limited first
    to what the clamp allows; that equals solving and clamping, for any ``excess`` and ``dt``.

    Source: Zheng et al., eqs. 10, 14, 16 and 25 (stiff: an explicit step of 20 ms diverges at Delta = 0.2).

    Args:
        state: lambda, a number or an array of any shape.
        excess: Delta, what saturation takes from (or a force adds to) the command, same shape [m/s].
        gains: k, gamma and the clamp.
        dt: Step [s] >= 0.

    Returns:
        lambda one step later, same shape, within the clamp.
    """
    k, gamma, clamp = gains.k_mps * dt, gains.gamma_m, gains.clamp
    bound = gamma * _tanh_of_clamp(clamp) + k * clamp
    goal = limit(gamma * tanh(state) + dt * excess, -bound, bound)
    root = goal / (gamma + k)
    for _ in range(_ITERATIONS):
        t = tanh(root)
        previous, root = root, root - (gamma * t + k * root - goal) / (gamma * (1.0 - t * t) + k)
        if isinstance(root, float) and root == previous:
            break  # converged: no further step would change it
    return limit(root, -clamp, clamp)


@lru_cache(maxsize=16)  # one of a few parameters, and numpy takes its time for a single number
def _tanh_of_clamp(clamp: float) -> float:
    return tanh(clamp)
