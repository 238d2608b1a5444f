"""From a scenario's text to a plan: its tables, its connections, values and order, checked against the FMUs."""
