"""Perception: pixels to tag corners, corners to poses, poses and odometry to estimates, without truth."""
