"""Annotated camera frames of a run, as files and as stills, and annotated photographs."""
