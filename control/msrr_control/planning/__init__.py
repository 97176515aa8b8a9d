"""Routes of the long-distance phase: planning them in what is known, and monitoring them on the way."""
