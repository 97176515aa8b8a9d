"""A trial: the loop over physics, sensors and robot, and the verdict of the judge."""
