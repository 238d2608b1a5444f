"""Write docs/site/motion.json, the membrane of the site's start page: ``python docs/make_motion.py``.

The default membrane under its built-in load; zone 6 loses 35 % of its stiffness and zone 12 20 % half way, as in the demo.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

STEP = 3e-4  # communication step [s]
EVERY = 14  # steps between two pictures: 30 in a period of the load
PICTURES = 121
DAMAGE = {6: 0.35, 12: 0.2}
NODES = 7  # per side within the edge, those that the membrane states
MOTION = Path(__file__).resolve().parent / "site" / "motion.json"


def motion(pictures: int = PICTURES) -> dict[str, Any]:
    """Simulate the membrane.

    Returns
    -------
    dict
        ``time`` [s] between two pictures; ``w``, for each picture the deflection of the nodes [0.1 mm] in rows of equal x;
        ``onset``, the first picture with damage; ``damage`` [1] by zone.
    """
    from gossamer_models import Stepper
    from gossamer_models.membrane import membrane_model

    membrane = Stepper(membrane_model())
    membrane.initialize()
    onset, names = PICTURES // 2, [f"w[{i},{j}]" for i in range(1, NODES + 1) for j in range(1, NODES + 1)]
    found = []
    for picture in range(pictures):
        if picture == onset:
            for zone, value in DAMAGE.items():
                membrane.set(f"damage[{zone}]", value)
        found.append([round(1e4 * float(membrane.get(name))) for name in names])
        for _ in range(EVERY):
            membrane.step(STEP)
    return {"time": STEP * EVERY, "onset": onset, "damage": DAMAGE, "w": found}


if __name__ == "__main__":
    MOTION.write_text(json.dumps(motion(), separators=(",", ":")) + "\n", encoding="utf-8")
