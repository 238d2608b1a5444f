"""Tables 7.1 to 7.5 of the thesis: damages of its test cases, what its networks said of them, and what it trained with.

M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite Sensors,
dissertation, Virginia Tech, 2010, Chapter 7. Predictions stand as they are printed, in %, one row a case, zones 1 to 16.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..arrays import Matrix

NOISE = (0.0, 0.02)  # of Section 7.7: uniform, of every sample of strain [1]
Damages: TypeAlias = tuple[dict[int, float], ...]  # damage [1] by zone of each case


@dataclass(frozen=True)
class ThesisTables:
    """Test cases of one training of the thesis.

    Attributes
    ----------
    name : str
        The two tables: without and with noise.
    cases : tuple of int, length n
        Numbers of the cases.
    damages : tuple of dict, length n
        Damage [1] by zone.
    clean, noisy : ndarray, shape (n, 16)
        Damage [%] that the thesis predicts; not a number where it prints none.
    """

    name: str
    cases: tuple[int, ...]
    damages: Damages
    clean: Matrix
    noisy: Matrix

    @property
    def damage(self) -> Matrix:
        """Damages as an array, shape (n, 16) [1]."""
        return as_array(self.damages)


def as_array(damages: Damages) -> Matrix:
    """Return damages by zone as an array, shape (n, 16) [1]."""
    found = np.zeros((len(damages), ZONES))
    for row, damage in zip(found, damages, strict=True):
        for zone, value in damage.items():
            row[zone - 1] = value
    return found


def _rows(text: str) -> Matrix:
    return np.array([line.split() for line in text.strip().splitlines()], dtype=float)


# Cases 1 to 17 of Tables 7.1 and 7.2. Table 7.1 prints zone 10 in case 16; its prediction and Table 7.2 say 11.
_SINGLE: Damages = (
    {},
    {1: 0.2},
    {1: 0.4},
    {2: 0.2},
    {2: 0.4},
    {3: 0.2},
    {3: 0.4},
    {1: 0.1},
    {1: 0.3},
    {2: 0.09},
    {2: 0.35},
    {3: 0.23},
    {3: 0.18},
    {3: 0.36},
    {1: 0.1, 3: 0.1, 10: 0.4},
    {1: 0.2, 3: 0.4, 11: 0.3},
    {1: 0.3, 4: 0.3, 13: 0.4},
)

# The reference cases of the second training, Table 7.3, as printed.
TABLE_7_3: Damages = (
    {},
    {1: 0.2},
    {1: 0.4},
    {2: 0.2},
    {2: 0.2, 12: 0.0106, 14: 0.0009},
    {2: 0.4},
    {3: 0.2},
    {3: 0.4},
    {1: 0.2, 3: 0.4, 5: 0.2},
    {1: 0.4, 3: 0.2, 5: 0.4},
    {1: 0.2, 2: 0.2, 10: 0.4},
    {1: 0.1, 3: 0.2, 9: 0.4},
    {2: 0.1, 3: 0.4, 8: 0.2, 12: 0.4},
    {1: 0.2, 3: 0.4, 5: 0.3, 9: 0.3, 12: 0.4},
    {1: 0.4, 3: 0.4, 5: 0.4},
    {1: 0.2, 2: 0.2, 4: 0.3, 10: 0.4},
)

# Cases 1 to 8 of Tables 7.4 and 7.5.
_MULTIPLE: Damages = (
    {1: 0.4, 5: 0.2, 9: 0.1},
    {2: 0.2, 5: 0.1, 8: 0.2},
    {8: 0.2, 12: 0.4, 13: 0.3},
    {2: 0.4, 8: 0.2, 12: 0.3},
    {3: 0.2, 5: 0.15, 10: 0.37},
    {2: 0.2, 7: 0.2, 12: 0.1},
    {1: 0.2, 3: 0.4, 5: 0.2},
    {1: 0.4, 3: 0.2, 5: 0.4, 10: 0.4},
)

# Table 7.1, cases 2 to 17: single-damage training, without noise.
_TABLE_7_1 = """
   20  0.02     0  0.02     0  0.03  0.01     0     0     0   0.3     0  0.01     0     0     0
   39     0     0     0     0  0.03     0  0.06     0  0.02     0     0     0     0  0.04     0
 0.02    20     0   1.1   0.1     0   0.2     0     0  0.09     0  0.01     0  0.25   0.5     0
    0 40.01   0.2  0.02     0     0     0   0.1     0     0   1.2     0  0.01     0     0     0
    0     0  20.1  0.02  1.01     0     0   0.1  0.01   0.2  0.01     0  0.01     0  0.02     0
    0     0 39.96     0  0.01  0.02     1     0     0  0.09     0     0     0  0.09     0     0
10.11     0     0   0.2  0.01     0     0  1.09     0  0.03     0     0     0     0   0.8     0
 30.1     0     0  0.02     0  0.01     0     0     0     0  0.01     0     0  0.02     0     0
    0  8.98     0     0     0     0     0  1.09     0     0     0  0.01     0  0.22     0     0
    0 35.05     0  1.03     0     1     0  0.04     0     0     0  1.08     0  0.06     0     0
    0     0 24.14     1     0     0     0     0     0  0.01     0     0     0     0     0     0
    0     0 18.12     0     0     0  1.03     0   0.1     0     0   0.4     0   0.2     0   0.2
    0     0 35.91  0.01     0  0.23  0.05     0  0.03     0     0     0  2.02     0     0     0
 9.75     0   4.6     0  0.12     0     0     0     0 34.29     0     9     0  0.04     2     6
16.11  0.01  45.1  1.01 10.23     0   1.2     0     0  5.28  28.1  0.05     0   0.8     0   0.9
25.69  0.01  0.01 24.12  0.04  0.98  0.67  7.01     0  6.32  1.12  5.65 65.34  0.44  2.13  0.45
"""
# Table 7.2, cases 2 to 17: with noise.
_TABLE_7_2 = """
 20.9  0.34     0  0.35  0.21  3.02   1.1  0.59   0.1   0.9     0  2.01  1.09  0.01   1.9  0.01
 40.1  1.01  0.61  0.03  0.38  0.43  0.01  0.35  0.01  0.02   0.1     0  0.98     0   0.2  0.09
    1 18.32  0.04  0.56  1.23  0.05  0.32  0.05  1.33  1.34  0.05  1.82  0.84  0.09  0.34  1.09
 0.02 38.02  2.09  0.22  0.02     0  0.08  1.43  0.04   0.4  1.04  0.06  0.03   0.4     1   0.1
 0.05   0.3 21.02  0.09  1.03  0.32  0.43  0.76   0.1  0.09  0.02  0.97  0.94   0.2   0.2     2
    0  0.04 41.95  0.03  0.56  0.23  2.91     5  1.01  2.11     0  0.02     1     0  2.09     0
 9.12  0.32  3.98  0.55  0.01   0.7  0.03  0.52  0.56  2.09  0.65  0.01     0  3.02  2.54     0
31.12  0.93  0.43  2.43  0.45   0.2  0.45     0     0  1.09     0  1.45  0.02  0.04  0.21  2.04
 0.54 10.01  0.97  0.06   0.3  0.23  0.11  2.06     0  0.02     0  3.43  0.34  2.11     0     0
    0 34.34  0.34  0.98  0.43  8.08  1.09  1.43  0.98  0.45     1  2.01  0.45  3.09  0.33  2.98
 0.02  0.44 21.54  0.45  0.34  2.12  0.09  0.04     0     2  0.22     1  0.03   0.2   0.6  0.02
    0     0 18.01  2.01  0.03  0.07  2.98  0.45  3.98  0.45  0.02   0.5   0.9  0.45  0.44  0.67
    0  0.04 37.13   0.7  0.78   0.2  1.04     0     3   0.5  0.16     0  0.65     2  1.65  0.45
11.34   0.3  8.13  0.54  0.22     0  0.01     0  0.21 37.22  0.01  6.98   0.1  0.02  7.99     0
14.22   0.2 34.11  0.02    11     2     0  6.12     0     0  34.1     4     0     0     3     0
34.17  0.05  0.21 23.15  0.55  0.43  2.01     0     0  5.54  0.44  3.02 67.93     0  2.11     0
"""
# Table 7.4, cases 1 to 8: multiple-damage training, without noise. 91 in zone 14 of case 8 is a misprint for 0.91.
_TABLE_7_4 = """
40.01   0.4     0     0 18.99  0.01   0.2     0 11.21  0.01     0     0     0     0     0     0
 0.02 19.21  0.01     0 11.21     0     0 19.21     0     0  0.01     0     0     0     0     0
    0  0.11     0  0.21  0.12     1     0 19.11  0.02  0.03  0.21 43.11 29.23  0.01  0.11  0.02
    0 38.91  0.11  0.01  0.22  1.23  0.02 21.09  0.21  0.01  1.01 28.99  0.02  0.03   0.2     0
 1.43  0.33 19.32  0.21 16.13  1.09  0.07  0.04  0.04 38.12  0.12     0     0  0.23     0     0
    0 21.23  0.32  0.12  0.23  1.32 18.23  0.32   0.2     0     0 12.32     0  1.11  1.32     0
19.22  0.22 39.32  0.02 21.09  0.79  0.12  0.09  1.32  0.32  0.01  1.43  0.43  1.08  0.06  0.98
40.11  0.33 19.12  0.22 36.98  0.32  1.32  0.01  1.02  37.9     0  1.09     0    91     0  1.09
"""
# Table 7.5, cases 1 to 8: with noise.
_TABLE_7_5 = """
38.62  0.07  0.89     0 18.32  0.65  1.23  0.11  8.23  0.01     0     0  0.12  0.01  0.02     0
    0 19.11  2.12  0.01  8.14  0.23     2 17.99  0.02  2.12  0.01  1.04  0.11     0  2.21     0
    0  0.23  1.78  1.45  0.56  0.34     0 18.01  0.21  0.22     0 43.01 27.12  0.13  0.01  1.21
    0 37.21  0.31  0.12  0.45  1.23  1.04 22.12  0.22     0  1.21 31.45  0.32  1.21     0     0
    2  0.26 19.01  0.31 14.13  1.41  0.71  1.62  0.82 38.62  1.19  0.02  1.09  0.01     0     0
 0.02 19.01  0.31     0  2.01     0 22.65  0.11     0     0  0.21     9   0.1     1     0  2.01
22.43  0.11 42.23  0.11 19.12  0.33   0.9  0.01  1.42     0     0     0     0     0     0  2.01
39.01  0.21 18.02  1.23 38.01  2.21     0     3  0.01 38.02     0  1.01     0  0.01     0     0
"""

_CLEAN, _NOISY = _rows(_TABLE_7_1), _rows(_TABLE_7_2)
ZONES = _CLEAN.shape[1]  # of the membrane of the thesis
_NONE = np.full((1, ZONES), np.nan)
SINGLE_TRAINING = ThesisTables(
    name="Tables 7.1 and 7.2",
    cases=tuple(range(1, 18)),
    damages=_SINGLE,
    clean=np.vstack([_NONE, _CLEAN]),
    noisy=np.vstack([_NONE, _NOISY]),
)
MULTIPLE_TRAINING = ThesisTables(
    name="Tables 7.4 and 7.5",
    cases=tuple(range(1, 9)),
    damages=_MULTIPLE,
    clean=_rows(_TABLE_7_4),
    noisy=_rows(_TABLE_7_5),
)
TABLES = (SINGLE_TRAINING, MULTIPLE_TRAINING)
GROUPS = (  # of the test cases: what, tables, and which of them
    ("Tables 7.1 and 7.2, 13 single", SINGLE_TRAINING, slice(1, 14)),
    ("Tables 7.1 and 7.2, 3 multiple", SINGLE_TRAINING, slice(14, 17)),
    ("Tables 7.4 and 7.5, 8 multiple", MULTIPLE_TRAINING, slice(0, 8)),
)
