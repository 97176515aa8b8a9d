"""What the commands that measure on pictures say of the pictures."""

from __future__ import annotations

#: Residual above which not all is as it was told [px]; good pictures have a tenth to a third of a pixel.
_POOR_RESIDUAL_PX = 0.5


def same_picture(name: str, first: str) -> str:
    """Return in words that a picture was not used, because an earlier one has the same pixels."""
    return f"left out: {name}: the same picture as {first}"


def poor_residual(rms_px: float, other_causes: str) -> list[str]:
    """Return what a large residual may come from, if this is one.

    ``other_causes`` is what may be wrong beside the pictures, if they are all alike.
    """
    if rms_px <= _POOR_RESIDUAL_PX:
        return []
    return [
        f"a residual of {rms_px:.2f} px is large: pictures that stand out are blurred, or show something bent"
        f"; if all are alike, {other_causes} may be wrong, or the pictures are of two cameras"
    ]
