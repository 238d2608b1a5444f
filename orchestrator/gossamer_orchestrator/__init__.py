"""Co-simulation of FMUs: scenarios, master, results."""
