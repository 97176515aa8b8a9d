"""Models of the sensors, which turn truth into messages: cameras, encoders, switches and command links."""
