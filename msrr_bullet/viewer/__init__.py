"""What a person looks at: the trial in a browser while it runs, and a page that replays it afterwards."""
