"""Drawing in pixels: an image to draw on, the projection of a scene into it, and the marks of a mission."""
