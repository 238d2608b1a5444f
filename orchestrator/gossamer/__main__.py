"""Run the command line as ``python -m gossamer``."""

from .cli import main

main()
