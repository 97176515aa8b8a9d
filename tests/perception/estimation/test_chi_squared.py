"""The quantiles are those of SciPy's distribution, without the import of its statistics."""

from __future__ import annotations

import pytest
from scipy.stats import chi2

from msrr_perception.estimation.chi_squared import chi_squared_quantile


@pytest.mark.parametrize("degrees_of_freedom", [1, 2, 3, 8])
@pytest.mark.parametrize("probability", [0.01, 0.5, 0.95, 0.99, 0.9999])
def test_quantiles_are_those_of_the_distribution(probability: float, degrees_of_freedom: int) -> None:
    assert chi_squared_quantile(probability, degrees_of_freedom) == chi2.ppf(probability, degrees_of_freedom)
