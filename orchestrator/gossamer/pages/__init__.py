"""Pages of what the commands find, a file per command."""
