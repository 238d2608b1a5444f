"""FMU files and their instances: archives, model descriptions, units, and calls through FMPy."""
