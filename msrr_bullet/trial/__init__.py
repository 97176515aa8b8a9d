"""A trial: the loop over physics, sensors and robot, the judge, and the result."""
