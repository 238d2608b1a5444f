"""Exchange scenarios with other tools: SSP archives in both directions, and containers in one FMU."""
