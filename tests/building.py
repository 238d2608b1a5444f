"""Build the FMU of a single model."""

from gossamer_fmus import build_models


def build_fmu(model, folder, readme=None, *, native=False):
    """Build ``<model name>.fmu`` in a folder; return its path."""
    return build_models({model.name: model}, folder, readme, native=native)[model.name]
