"""The film of a run: its pictures, the view of the whole scene in three dimensions, and its file."""
