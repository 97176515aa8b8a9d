"""The simulation in PyBullet: world, units, obstacles, tags, pin lock, and the plant with contact."""
