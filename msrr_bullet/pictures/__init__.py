"""Pictures of a finished trial: frames drawn upon, curves over time, one page that sums it up."""
