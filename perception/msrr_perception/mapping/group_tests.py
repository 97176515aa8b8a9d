"""Statistical tests of groups of corners against all others of a map.

A group is tested against the map that all others make: if it is like the others, what vanishes from the sum
of squares together with it, by what is left, has an F distribution. The groups are single sightings, all
sightings of a tag (it moved) and all of a picture (it is blurred, or its tags moved). Source: W. Baarda, "A
testing procedure for use in geodetic networks", 1968 (data snooping), for groups.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from msrr_perception.mapping.adjustment import Adjusted, AdjustmentError
from msrr_perception.mapping.bundle import Sightings
from msrr_scenes.arrays import Array

#: Share of a corner that has to be checked by others for it to count in the test.
_LEAST_REDUNDANCY = 1e-6

Kind = Literal["sighting", "tag", "picture"]


@dataclass(frozen=True, eq=False)
class Group:
    """Corners that are tested together.

    Attributes:
        kind: What they are.
        members: Indices of the sightings, shape (k,).
    """

    kind: Kind
    members: NDArray[np.intp]


class Usual(NamedTuple):
    """How the quantiles of groups of one kind spread.

    Blur differs from picture to picture and paper from tag to tag, and what several corners of one tag have
    in common does not average out. So the groups may spread more widely than F; less widely does not count.
    """

    middle: float
    spread: float

    @classmethod
    def of(cls, quantiles: Sequence[float]) -> Usual:
        """Return how some quantiles spread; as a normal distribution does if there are none."""
        if not quantiles:
            return cls(0.0, 1.0)
        middle = float(np.median(quantiles))
        spread = float(np.median(abs(np.array(quantiles) - middle))) / float(norm.ppf(0.75))
        return cls(max(middle, 0.0), max(spread, 1.0))

    def score(self, quantile: float) -> float:
        """Return by how many deviations a group stands out from the others."""
        return (quantile - self.middle) / self.spread


class GroupTest(NamedTuple):
    """The test of a group."""

    group: Group
    excess: float  # what it adds to the sum of squares [px^2]
    rank: int  # number of its numbers that are checked
    quantile: float  # of a standard normal distribution that is as unlikely

    @property
    def rms_px(self) -> float:
        """Root mean square of its numbers that others check, against these [px]."""
        return math.sqrt(self.excess / self.rank)

    def score(self, usual: Mapping[Kind, Usual]) -> float:
        """Return by how many deviations it stands out from what is usual for its kind."""
        return usual[self.group.kind].score(self.quantile)


class GroupTests:
    """The tests of all groups of an adjustment.

    Attributes:
        all: Those of groups that others check, at least one.
        usual: How the quantiles spread, by kind.
    """

    def __init__(self, found: Adjusted, seen: Sightings) -> None:
        """Test all groups of the sightings that an adjustment is of.

        Raises:
            AdjustmentError: No group is checked by others.
        """
        self._found, self._Q = found, found.factor.solve(np.eye(found.bundle.variables))
        tested = [(group, *self._tested(group)) for group in _groups(seen)]
        self.all = [
            GroupTest(group, excess, rank, _quantile(found, excess, rank))
            for group, excess, rank in tested
            if rank
        ]
        if not self.all:
            raise AdjustmentError("no corner is checked by others; take more pictures of every tag")
        self.usual: Mapping[Kind, Usual] = {
            kind: Usual.of([test.quantile for test in self.all if test.group.kind == kind])
            for kind in get_args(Kind)
        }

    def sightings_behind(self, group: Group, is_likely: Callable[[float], bool]) -> list[GroupTest]:
        """Return those of a group, less than half, without which its others agree with the rest.

        They are found one after the other, each as that which takes most from the sum of squares together
        with those before. ``is_likely`` says whether the quantile of a group is one of a group that agrees.

        Returns:
            The test of each sighting; empty if a rest of more than half of the group does not agree.
        """
        whole, of_whole = self._tested(group)
        r, C = self._unexplained(group)
        few: list[GroupTest] = []
        taken, of_taken, left = 0.0, 0, list(range(len(group.members)))
        while 2 * (len(few) + 1) < len(group.members):
            redundancy, directions = np.linalg.eigh(np.array([C[_own(k), _own(k)] for k in left]))
            checked = redundancy > _LEAST_REDUNDANCY
            along = np.einsum("kij,ki->kj", directions, np.array([r[_own(k)] for k in left]))
            weight = np.where(checked, 1.0, 0.0) / np.where(checked, redundancy, 1.0)
            excess = (along**2 * weight).sum(axis=1)
            n = int(np.argmax(excess))
            rank, k = int(checked[n].sum()), left.pop(n)
            if not rank:  # nothing else checks what is left
                return []
            one, own = Group("sighting", group.members[k : k + 1]), float(excess[n])
            few.append(GroupTest(one, own, rank, _quantile(self._found, own, rank)))
            taken, of_taken = taken + own, of_taken + rank
            if of_whole <= of_taken or is_likely(
                _quantile(self._found, whole - taken, of_whole - of_taken, taken, of_taken)
            ):
                return few
            # Without that sighting, the others of the group are checked by the rest alone.
            gain = C[:, _own(k)] @ (directions[n] * weight[n]) @ directions[n].T
            r, C = r - gain @ r[_own(k)], C - gain @ C[_own(k)]
        return []

    def _tested(self, group: Group) -> tuple[float, int]:
        """Return what a group adds to the sum of squares [px^2], and how many of its numbers are checked."""
        r, C = self._unexplained(group)
        redundancy, directions = np.linalg.eigh(C)
        checked = redundancy > _LEAST_REDUNDANCY
        along = directions[:, checked].T @ r
        return float((along**2 / redundancy[checked]).sum()), int(checked.sum())

    def _unexplained(self, group: Group) -> tuple[Array, Array]:
        """Return the residuals of a group [px], and the matrix by which they follow from its errors."""
        rows = (8 * group.members[:, np.newaxis] + np.arange(8)).ravel()
        r, J = self._found.residuals[rows], self._found.jacobian[rows]
        columns = np.unique(J.indices)  # of few poses: all others are zero
        by_poses = J[:, columns].toarray()
        return r, np.eye(len(rows)) - by_poses @ self._Q[np.ix_(columns, columns)] @ by_poses.T


def _own(sighting: int) -> slice:
    """Return the rows of one sighting of a group."""
    return slice(8 * sighting, 8 * sighting + 8)


def _groups(seen: Sightings) -> list[Group]:
    groups = [Group("sighting", np.array([i])) for i in range(len(seen))]
    tags = [Group("tag", np.flatnonzero(seen.tag == tag)) for tag in np.unique(seen.tag)]
    pictures = [Group("picture", np.flatnonzero(seen.view == view)) for view in np.unique(seen.view)]
    return groups + [group for group in tags + pictures if len(group.members) > 1]


def quantile_outside(excess: float, rank: int, sigma_px: float) -> float:
    """Return the quantile of a standard normal distribution that is as unlikely as residuals of a given map.

    Source: E. B. Wilson, M. M. Hilferty, "The distribution of chi-square", PNAS 17, 1931.

    Args:
        excess: Sum of the squares of the residuals [px^2].
        rank: Number of the residuals.
        sigma_px: Standard deviation of residuals that belong to the map [px].
    """
    own = 2.0 / (9.0 * rank)
    return (math.cbrt(excess / rank / sigma_px**2) - (1.0 - own)) / math.sqrt(own)


def _quantile(found: Adjusted, excess: float, rank: int, without: float = 0.0, of_without: int = 0) -> float:
    """Return the quantile of a standard normal distribution that is as unlikely as what a group adds.

    What it adds is compared with what is left without it, so that a group which spoils the whole map is told
    from those that it spoils. Source: E. Paulson, "An approximate normalization of the analysis of variance
    distribution", Annals of Mathematical Statistics 13, 1942; the tail of F itself underflows.

    Args:
        found: The adjustment of all.
        excess: What the group adds to the sum of squares [px^2].
        rank: Number of its numbers that are checked.
        without: What others add that are left out as well [px^2].
        of_without: Number of theirs that are checked.
    """
    others = found.redundancy - rank - of_without
    left = found.sigma_px**2 * found.redundancy - excess - without
    if others <= 0 or left <= 0.0:  # nothing is left that could be compared
        return 0.0
    root = math.cbrt(excess / rank / (left / others))
    own, rest = 2.0 / (9.0 * rank), 2.0 / (9.0 * others)
    return ((1.0 - rest) * root - (1.0 - own)) / math.sqrt(rest * root**2 + own)
