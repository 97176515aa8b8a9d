"""Compilation of the renderer's kernels, and the folder that keeps their machine code."""

from __future__ import annotations

from pathlib import Path

from msrr_perception.kernels.compiled import KernelCompiler, chosen_by_type, inlined, subroutine

__all__ = ["chosen_by_type", "compiler", "inlined", "kernel", "subroutine"]

#: A kernel inlines functions of other files, so a change of any file of this package makes all machine code
#: stale. No result may depend on how a sum is grouped: a window has to equal the crop of its frame.
compiler = KernelCompiler(Path(__file__).resolve().parent)

kernel = compiler.kernel
