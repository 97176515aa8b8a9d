"""The covariance of the overhead estimates against their errors, on rendered frames.

``pytest -s -m nightly tests/bullet/robot/test_overhead_covariance.py`` prints the figures that
``docs/explanation/estimator.md`` cites.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, Twist

ARENAS = 12
#: Unit a and unit c drive between these times [s] and change their twist once a second.
SETS_OFF_S, STOPS_S, ENDS_S = 1.0, 5.0, 6.5
#: Time after a start of which nobody else can know: who stands is read 2.5 times a second, 60 ms late.
UNKNOWN_S = 0.6

#: Numbers that a unit can have: each has a tag of its own on top.
UNIT_NUMBERS = 50

#: Unit -> middle of the square in which it starts, and bounds of its heading. The drives do not meet.
PLACES = {
    "a": ((0.0, 0.15), (-3.1, 3.1)),
    "b": ((1.4, 0.5), (-3.1, 3.1)),
    "c": ((-1.4, -1.0), (-0.3, 0.0)),
    "d": ((1.4, -0.4), (-3.1, 3.1)),
    "e": ((-1.4, 0.6), (-3.1, 3.1)),
}


def twists(rng: np.random.Generator) -> Callable[[float], Twist]:
    """A drive whose accelerations are as large, on average, as those of the laws in the shipped scenes."""
    drawn = [Twist(rng.uniform(0.1, 0.3), rng.uniform(-0.4, 0.4)) for _ in range(math.ceil(STOPS_S))]
    return lambda t: drawn[int(t)] if SETS_OFF_S <= t < STOPS_S else Twist()


def compare(pose: GlobalPose, true: SE2) -> tuple[float, float, float]:
    """Return NEES, and the squares of the distance [m^2] and of the yaw error [rad^2]."""
    e = pose.X_WB.as_array() - true.as_array()
    e[2] = math.remainder(e[2], 2.0 * math.pi)
    return float(e @ np.linalg.solve(pose.covariance, e)), float(e[0] ** 2 + e[1] ** 2), float(e[2] ** 2)


@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("blur_px", [0.0, 1.0])
@pytest.mark.parametrize("noise_grey", [0.0, 2.0, 8.0])
def test_nees_on_rendered_frames(open_arena: Callable, noise_grey: float, blur_px: float) -> None:
    """Twelve arenas: the mean NEES lies between 1.5 and 6, where 3 is right, for units that stand and drive.

    Units that stand give one value each, of 60 places, headings and tags drawn independently. If the NEES is
    distributed as chi-square, the mean of 60 leaves 2.1 .. 4.1 once in 1000 times, and one whose true mean is
    2 or 4.5 leaves 1.5 .. 6 as rarely. So the last measurements of all that stand are held to these bounds.
    Their estimates allow for a drift of 10 um per square root of a second, and nothing here drifts: where a
    measurement errs by 9 um (1 px of blur, no noise) their variances are 1.6 times those of measurements. By
    as much, the median over all that stand, their NEES counts for more.
    Own units and targets alone are 12 values each, 1.2 .. 5.9 in 999 of 1000 cases; their bounds are wider by
    half, for the errors of sharp edges have longer tails than assumed (at slopes near 1:2 the sections of an
    edge lie alike between the pixels). Of units that drive every control instant counts.
    """
    squares: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    wider: list[float] = []
    for seed in range(ARENAS):
        rng = np.random.default_rng(100 + seed)
        poses = {
            name: SE2(*(np.array(middle) + rng.uniform(-0.15, 0.15, 2)), rng.uniform(*headings))
            for name, (middle, headings) in PLACES.items()
        }
        arena = open_arena(
            seed,
            plant="bullet",
            overhead={"noise_grey": noise_grey, "blur_px": blur_px, "samples": 2},
            obstacles={},
            start=poses.pop("a"),
            target=poses.pop("b"),
            others=poses,
            numbers=np.random.default_rng(seed).permutation(UNIT_NUMBERS).tolist(),
        )
        own, other = twists(rng), twists(rng)
        arena.law, arena.drivers = lambda t, known, own=own: own(t), {"c": other}

        def watch(arena=arena) -> None:
            if SETS_OFF_S + UNKNOWN_S < arena.now_s < STOPS_S:
                squares["own drives"].append(compare(arena.known.own, arena.plant.pose("a")))
                squares["other drives"].append(compare(arena.known.others[0], arena.plant.pose("c")))

        arena.run(ENDS_S, watch)
        known, localizer = arena.known, arena.vision.model.localizer()
        seen = {pose.name: pose for look in arena.looks for pose in localizer.locate(look)}
        squares["all measured"] += [compare(pose, arena.plant.pose(name)) for name, pose in seen.items()]
        for kind, pose in [
            ("own", known.own),
            ("target", known.target),
            *(("other", o) for o in known.others),
        ]:
            squares[f"{kind} stands"].append(compare(pose, arena.plant.pose(pose.name)))
            wider.append(np.trace(np.linalg.solve(seen[pose.name].covariance, pose.covariance)) / 3.0)
    squares["all stand"] = [n for k in ("own", "target", "other") for n in squares[f"{k} stands"]]
    means = {}
    print(f"\n{noise_grey:g} grey levels, {blur_px:g} px:", end="")
    for kind, values in squares.items():
        means[kind], distance, yaw = np.mean(values, axis=0)
        rms = f"{1e3 * math.sqrt(distance):.2f} mm, {1e3 * math.sqrt(yaw):.1f} mrad"
        print(f" {kind} {means[kind]:.1f} ({rms});", end="")
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 3 * ARENAS) / ARENAS
    assert low / 1.5 < means["own stands"] < 1.5 * high
    assert low / 1.5 < means["target stands"] < 1.5 * high
    assert 1.5 < means["all stand"] * max(float(np.median(wider)), 1.0) < 6.0
    for kind in ("all measured", "own drives", "other drives"):
        assert 1.5 < means[kind] < 6.0, kind
