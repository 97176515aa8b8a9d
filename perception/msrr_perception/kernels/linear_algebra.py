"""Symmetric positive definite equations, as steps of inner loops."""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.kernels.compiled import inlined, subroutine
from msrr_scenes.arrays import Array


@subroutine
def cholesky(A: Array, L: Array) -> bool:
    """Write the lower triangle L with ``L L^T = A``; return whether A is positive definite."""
    n = A.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    return True


@subroutine
def solve(L: Array, b: Array, out: Array) -> None:
    """Write the solution of ``L L^T out = b``."""
    n = L.shape[0]
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * out[k]
        out[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= L[k, i] * out[k]
        out[i] = total / L[i, i]


@inlined
def inverse(L: Array, out: Array) -> None:
    """Write the inverse of ``L L^T``, symmetric to the last bit."""
    n = L.shape[0]
    unit, column = np.empty(n), np.empty(n)
    for j in range(n):
        for i in range(n):
            unit[i] = 1.0 if i == j else 0.0
        solve(L, unit, column)
        for i in range(j, n):
            out[i, j] = out[j, i] = column[i]
