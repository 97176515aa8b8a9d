"""A map of tags from pictures of them: where every tag is, from the corners that were detected."""
