"""Routes of the long-distance phase: planned among the known bodies, and monitored on the way."""
