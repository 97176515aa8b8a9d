"""Settings of the detection compared on rendered pixels whose truth is known."""
