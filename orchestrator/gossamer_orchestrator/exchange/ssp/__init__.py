"""System Structure and Parameterization (SSP 1.0) archives, written and read."""
