"""A map of real tags from pictures: reads the pictures, writes the map, draws it and its residuals."""
