"""The page docs/identification.md: ``compute`` fits once, each chapter turns fits into text and pictures."""
