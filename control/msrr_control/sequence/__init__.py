"""The sequence of one docking step: the phase machine, and what it observes at every control instant."""
