"""What a scene is: validated specifications, planar and spatial poses, and the messages between rooms."""
