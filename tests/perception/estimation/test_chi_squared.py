"""The quantiles are those of SciPy's distribution, without its import."""

from __future__ import annotations

import subprocess
import sys

import pytest
from scipy.stats import chi2

from msrr_perception.estimation.chi_squared import chi_squared_quantile


@pytest.mark.parametrize("degrees_of_freedom", [1, 2, 3, 8])
@pytest.mark.parametrize("probability", [0.01, 0.5, 0.95, 0.99, 0.9999])
def test_quantiles_are_those_of_the_distribution(probability: float, degrees_of_freedom: int) -> None:
    expected = chi2.ppf(probability, degrees_of_freedom)
    assert chi_squared_quantile(probability, degrees_of_freedom) == pytest.approx(expected, rel=1e-13)


def test_what_a_trial_imports_loads_no_scipy() -> None:
    program = "import sys, msrr_bullet.run; raise SystemExit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
