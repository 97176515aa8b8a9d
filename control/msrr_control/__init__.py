"""From estimates to velocities: the laws, the comparison controllers and the phase machine."""
