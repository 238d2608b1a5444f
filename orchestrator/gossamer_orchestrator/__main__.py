"""Run the command line as ``python -m gossamer_orchestrator``."""

from .cli import app

app(prog_name="gossamer")
