"""Write docs/membrane.md and its pictures: error of the membrane's histories against cost, for each mesh.

Run ``make figures``; it takes minutes, most of them to compile kernels.
"""

from __future__ import annotations

from pathlib import Path

from studies.membrane_page import write
from studies.mesh_error import run_study

if __name__ == "__main__":
    write(run_study(print), Path(__file__).resolve().parent)
