"""The triangles of an STL file, binary or text."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from msrr_scenes.arrays import Array


def stl_corners(path: Path) -> Array:
    """Return the corners of the triangles of an STL file, shape (3 N, 3), in the units of the file.

    Raises:
        ValueError: The file is malformed.
    """
    data = path.read_bytes()
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    count = int(np.frombuffer(data[80:84], "<u4")[0]) if len(data) >= 84 else -1
    if len(data) == 84 + count * record.itemsize:
        corners = np.frombuffer(data[84:], record)["corners"].astype(np.float64).reshape(-1, 3)
    else:
        text = (line.split() for line in data.decode("ascii", "replace").splitlines())
        corners = np.array([[float(w) for w in words[1:4]] for words in text if words[:1] == ["vertex"]])
    if corners.size == 0 or corners.size % 9:
        raise ValueError("no triangles")
    return corners
