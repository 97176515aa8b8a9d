"""The software of a docking unit: perception, control, collision monitor. It never imports the simulator."""
