"""The tolerance study: what each deviation from the drawing costs, and what to build more precisely first."""
