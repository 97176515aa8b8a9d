"""The software of the base station that leads many units. It never imports the simulator."""
