"""Checks of a scene against what a trial builds of it: bodies, views, programs; nothing is run."""
