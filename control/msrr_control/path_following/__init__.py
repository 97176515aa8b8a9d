"""The long-distance phase: paths, and the laws that drive a unit along them past obstacles."""
