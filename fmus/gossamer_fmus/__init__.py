"""Names, units and packaging: builds FMUs from step models."""
