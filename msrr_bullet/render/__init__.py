"""Renderers: noise-free pixels of a window of a camera's image, from the state of the simulated world."""
