"""Checks: what makes a scene unusable although each of its values is allowed, and how to mend it."""
