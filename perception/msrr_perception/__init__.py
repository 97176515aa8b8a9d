"""From pixels to poses: detection, joint pose, line of sight, filter. Knows no truth and no simulator."""
