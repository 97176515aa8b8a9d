"""Recordings of a robot's camera, read with its own perception: films, pictures, MCAP files."""
