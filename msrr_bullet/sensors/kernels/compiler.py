"""Compilation of the sensors' kernels, and the folder that keeps their machine code."""

from __future__ import annotations

from pathlib import Path

from msrr_perception.kernels.compiled import KernelCompiler

compiler = KernelCompiler(Path(__file__).resolve().parent)

kernel = compiler.kernel
