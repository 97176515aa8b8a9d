"""The radio between the base station and the units: messages arrive late, out of order, or not at all."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np

from msrr_bullet.sensors.schedule import Delayed, duration_ns
from msrr_scenes.messages import seconds
from msrr_scenes.messages.coordination import Authority, UnitReport
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.mission import RadioSpec

M = TypeVar("M")


class RadioLink(Generic[M]):
    """One direction of the radio for one unit, which counts the messages sent and those lost of them."""

    def __init__(self, spec: RadioSpec, unit: str, rng: np.random.Generator, under_way: Delayed[M]) -> None:
        """Draw losses and delays from ``rng``, which no other object uses.

        Messages that are not lost are put into ``under_way``.
        """
        self._spec, self._rng = spec, rng
        self._latency_ns = duration_ns(1e-3 * spec.latency_ms)
        self._silences = [s for s in spec.silences if not s.units or unit in s.units]
        self._under_way = under_way
        self.sent = self.lost = 0

    def send(self, message: M, now_ns: int) -> None:
        """Send a message; two numbers are drawn for each, whatever becomes of it."""
        loss, delay = self._rng.random(2).tolist()
        self.sent += 1
        if loss < self._spec.loss or any(s.from_s <= seconds(now_ns) < s.until_s for s in self._silences):
            self.lost += 1
            return
        jitter_ns = round(delay * duration_ns(1e-3 * self._spec.jitter_ms))
        self._under_way.send(now_ns + self._latency_ns + jitter_ns, message)


class Radio:
    """All links of a trial."""

    def __init__(self, spec: RadioSpec, units: tuple[str, ...], seed: int) -> None:
        """Draw from the streams ``radio/<unit>/down`` and ``radio/<unit>/up``."""
        self._order = {unit: k for k, unit in enumerate(units)}
        self._down: Delayed[Authority] = Delayed()
        self._up: Delayed[UnitReport] = Delayed()
        self.to_units = {u: RadioLink(spec, u, stream(seed, f"radio/{u}/down"), self._down) for u in units}
        self.from_units = {u: RadioLink(spec, u, stream(seed, f"radio/{u}/up"), self._up) for u in units}

    @property
    def next_ns(self) -> float:
        """Time at which the next message arrives anywhere [ns]."""
        return min(self._down.next_ns, self._up.next_ns)

    def arrived_at_units(self, now_ns: int) -> dict[str, list[Authority]]:
        """Remove and return the authorities that have arrived by ``now_ns``, by unit."""
        arrived: dict[str, list[Authority]] = {}
        for authority in self._down.arrived(now_ns):
            arrived.setdefault(authority.unit, []).append(authority)
        return arrived

    def arrived_at_base(self, now_ns: int) -> list[UnitReport]:
        """Remove and return the reports that have arrived by ``now_ns``, in the order of the units."""
        return sorted(self._up.arrived(now_ns), key=lambda report: self._order[report.unit])

    @property
    def sent(self) -> int:
        """Number of messages sent."""
        up, down = self.from_units.values(), self.to_units.values()
        return sum(link.sent for link in up) + sum(link.sent for link in down)

    @property
    def lost(self) -> int:
        """Number of messages lost."""
        up, down = self.from_units.values(), self.to_units.values()
        return sum(link.lost for link in up) + sum(link.lost for link in down)
