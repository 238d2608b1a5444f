"""Files that an FMU carries for programs that draw it, and where numbers lie in its serialized state.

::

    resources/<name>         as the model has it
    resources/state.json     where the variables and the state of the model lie, if there are such files
"""

from __future__ import annotations

import json

from gossamer_models import StepModel

_HEAD = 8 + 16 + 4  # magic, digest and checksum [byte], in both kinds
_BEFORE = {
    True: 4 * 8,
    False: 1,
}  # what stands before the variables: in C (stepper.h, State) and in Python (stepper.py)


def resources(model: StepModel, *, native: bool) -> dict[str, bytes]:
    """Return the files below ``resources/`` by path; none if the model has none.

    Parameters
    ----------
    model : StepModel
        The model.
    native : bool
        Which kind of FMU; the states of the two differ.

    Notes
    -----
    ``values`` and ``x`` of ``state.json`` are the places [byte] of the variables, in the order of the table, and of the
    states of the model; both are doubles in the order of this machine's bytes.
    """
    if not model.resources:
        return {}
    begin = _HEAD + _BEFORE[native]
    card = {
        "schema": "gossamer.state",
        "version": 1,
        "values": begin,
        "n_values": len(model.variables),
        "x": begin + 8 * len(model.variables),
        "n_x": model.n_states,
    }
    files = model.resources | {"state.json": json.dumps(card, indent=1).encode()}
    return {f"resources/{name}": data for name, data in files.items()}
