"""Pages of what the commands find."""
