"""Second implementations that the models are tested against; no user needs them."""
