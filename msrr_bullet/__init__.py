"""A testbed in which mobile self-reconfigurable robots dock by what their cameras see."""
