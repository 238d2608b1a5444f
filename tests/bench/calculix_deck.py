"""Write the thesis membrane for CalculiX: the deck behind the reference histories, for its cost beside ours."""

import math


def calculix_deck(steps, *, elements=8, side=0.588, stretch=0.006, h=3e-4):
    """Return an input file's text: static stretching, then implicit steps of ``h`` seconds under 10 kPa at 7.9 Hz."""
    numbers = range(elements + 1)
    node = {(i, j): j * (elements + 1) + i + 1 for j in numbers for i in numbers}
    corners = [(i, j) for j in range(elements) for i in range(elements)]
    held, free = [], []
    for (i, j), number in node.items():
        if {i, j} & {0, elements}:
            held += [f"{number}, 1, 1, {stretch * (2 * i / elements - 1)!r}"]
            held += [f"{number}, 2, 2, {stretch * (2 * j / elements - 1)!r}", f"{number}, 3, 3, 0."]
        else:
            free.append(f"{number}, 3, 3, 0.")
    lines = [
        *("*HEADING", "thesis membrane", "*NODE, NSET=ALL"),
        *(f"{number}, {i * side / elements!r}, {j * side / elements!r}, 0." for (i, j), number in node.items()),
        "*ELEMENT, TYPE=M3D4, ELSET=SKIN",
        *(
            f"{k}, {node[i, j]}, {node[i + 1, j]}, {node[i + 1, j + 1]}, {node[i, j + 1]}"
            for k, (i, j) in enumerate(corners, 1)
        ),
        *("*NSET, NSET=CENTRE", str(node[elements // 2, elements // 2])),
        *("*MATERIAL, NAME=FOIL", "*ELASTIC", "1e7, 0.33", "*DENSITY", "1100."),
        *("*MEMBRANE SECTION, ELSET=SKIN, MATERIAL=FOIL", "1e-3"),
        "*AMPLITUDE, NAME=LOAD",
        *(f"{k * h!r}, {1e4 * math.sin(15.8 * math.pi * k * h)!r}" for k in range(steps + 1)),
        *("*STEP, NLGEOM", "*STATIC", "1., 1.", "*BOUNDARY", *held, *free),
        *("*EL PRINT, ELSET=SKIN, FREQUENCY=100000", "ENER", "*END STEP"),
        *("*STEP, NLGEOM, INC=100000", "*DYNAMIC, ALPHA=-0.05, DIRECT", f"{h!r}, {steps * h!r}"),
        *("*BOUNDARY, OP=NEW", *held, "*DLOAD, AMPLITUDE=LOAD", "SKIN, P, 1."),
        *("*NODE PRINT, NSET=CENTRE", "U", "*END STEP"),
    ]
    return "\n".join(lines) + "\n"
