"""The command link between a robot's computer and its wheels: it delays, and it loses."""

from __future__ import annotations

import numpy as np

from msrr_bullet.sensors.schedule import Delayed, duration_ns
from msrr_scenes.messages import Action
from msrr_scenes.specs.vehicle import LinkSpec


class CommandLink:
    """Carries one unit's actions to its drive. A lost action leaves the last one in force."""

    def __init__(self, spec: LinkSpec, rng: np.random.Generator) -> None:
        """Use ``rng`` (stream ``unit/<name>/link``) for the losses."""
        self._loss = spec.loss
        self._latency_ns = duration_ns(spec.latency_ms * 1e-3)
        self._rng = rng
        self._under_way: Delayed[Action] = Delayed()

    def send(self, action: Action) -> None:
        """Send an action; one number is drawn whether or not links lose, so that streams stay aligned."""
        if self._rng.random() >= self._loss:
            self._under_way.send(action.stamp_ns + self._latency_ns, action)

    def arrived(self, now_ns: int) -> Action | None:
        """Return the newest action that has arrived since the last call, if any."""
        actions = self._under_way.arrived(now_ns)
        return actions[-1] if actions else None
