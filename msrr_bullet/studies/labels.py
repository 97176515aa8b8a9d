"""The names of controllers in tables and figures."""

from __future__ import annotations

#: What every table, figure and sentence says of C2.
C2 = "C2 (our reading)"

#: The same in a sentence.
C2_NOTE = (
    "The paper prints no equations of its comparison C2. What is called so here is our reading of what it"
    " says in words: sliding tracking with a boundary layer at C1's linear gains, C1's line-of-sight"
    " correction, a radial potential about obstacles, and no anti-windup. What is said of it holds of this"
    " reading alone."
)


def label_of(controller: str, tuned: bool = False) -> str:
    """Return the label of a controller, given by its registered name."""
    label = C2 if controller == "c2" else controller.upper()
    return f"{label}, tuned" if tuned else label
