"""Display of a trial in a browser: live while it runs, and as a self-contained page that replays it."""
