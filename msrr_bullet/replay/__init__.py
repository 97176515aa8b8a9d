"""Recording of all that robots and a base station get and do, and replay of it without the simulator."""
