"""How the renderer's kernels are compiled, and where their machine code is kept."""

from __future__ import annotations

from pathlib import Path

from msrr_perception.kernels.compiled import KernelCompiler, inlined

__all__ = ["compiler", "inlined", "kernel"]

#: A kernel inlines steps of other files, so every source of this package decides what is stale. Results must
#: not depend on how a sum is grouped, or a window would no longer equal the crop of its frame.
compiler = KernelCompiler(Path(__file__).resolve().parent)

kernel = compiler.kernel
