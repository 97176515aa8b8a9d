"""The long-distance phase as a whole: its states, its parameters, and the follower of its routes."""
