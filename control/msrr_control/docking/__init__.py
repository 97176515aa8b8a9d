"""The close-range phase: the laws that drive a unit into the port, and the controllers that run them."""
