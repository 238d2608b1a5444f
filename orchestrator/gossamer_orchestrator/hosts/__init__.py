"""FMUs as modules of other simulation programs; each file needs its program, and is imported by name."""
