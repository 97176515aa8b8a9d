"""A docking controller of one's own, named in a scene by its import path.

Run it: ``python examples/own_controller.py``.
"""

import math

from msrr_control.docking.controller import ControlInputs, DockSetup
from msrr_scenes.messages import Twist


class Pursuit:
    """Steers at a point that runs ahead on the port's axis; slows down in front of the port."""

    def __init__(self, setup: DockSetup, ahead_m: float = 0.15, cruise_mps: float = 0.15) -> None:
        """Take the facts of the docking step and the scene's own parameters."""
        self.setup, self.ahead, self.cruise = setup, ahead_m, cruise_mps

    def reset(self, inputs: ControlInputs) -> None:
        """Begin an approach; nothing is remembered between two of them."""

    def step(self, inputs: ControlInputs) -> Twist:
        """Return the command for this instant, from the estimated pose in the port's frame."""
        pose = inputs.pose.X_DU
        gap = -pose.x - self.setup.offset * math.cos(pose.yaw)
        v = min(self.cruise, 0.03 + 0.5 * max(gap, 0.0))
        wanted = math.atan2(-pose.y, self.ahead)
        widest = 0.5 * self.setup.los.inner  # never turns the marker out of sight
        error = max(-widest, min(wanted, widest)) - pose.yaw
        return Twist(v, 2.0 * v / self.ahead * math.sin(error))


if __name__ == "__main__":
    from msrr_bullet import load_scene, run_trial

    chosen = "{name: 'own_controller:Pursuit', params: {cruise_mps: 0.12}}"
    result = run_trial(load_scene("close_range", {"control.docking": chosen}), seed=1)
    print(f"{result.outcome.value} after {result.duration_s:.1f} s: {result.steps[0].belief_reason}")
