"""Table 2 of Feng et al. 2024 (Electronics 13, 68) as printed, and which of its rows no experiment can produce."""

from __future__ import annotations

import math
from dataclasses import dataclass

WOLVES = ("gwo", "mgwo", "igwo", "sogwo", "ssgwo")
RUNS = 50

# Columns in the order of WOLVES.
_TABLE_2 = """
f1 mean  3.2532e-26 3.5394e-196  2.8327e-28  3.3227e-76           0
f1 std   1.3267e-26 2.8467e-198  3.2597e-29 2.79548e-78 2.6741e-199
f1 best  4.4327e-30           0  1.3879e-32  1.3261e-80 1.1349e-199
f2 mean  3.2671e-13  1.5371e-77  3.1679e-19  1.8342e-65  1.1463e-85
f2 std   3.2481e-14  2.6137e-78  3.2467e-20  2.8643e-68  2.7239e-86
f2 best  2.2738e-15  1.3367e-80  3.2497e-23  2.1973e-70  1.2371e-87
f3 mean   2.8237e01   2.7136e01   2.4837e01   2.5197e01   2.0637e01
f3 std   2.2537e-01  6.2276e-01  2.6927e-01  2.4977e-01  4.1876e-02
f3 best  2.6192e-01  4.7431e-01  4.4293e-01  2.3291e-01  2.4037e-02
f4 mean  2.6217e-06  5.2739e-90  3.3392e-46  3.5731e-96           0
f4 std   3.5127e-06  3.2267e-90  1.9643e-45  4.3797e-98           0
f4 best  6.1837e-07  1.6239e-91  1.7234e-48 2.7944e-101           0
f5 mean  2.7945e-07 3.3754e-160  2.2738e-04 1.7322e-106 2.7254e-178
f5 std   2.8153e-06 4.7687e-161  3.7327e-04 2.7528e-107 3.3784e-180
f5 best  4.1687e-08           0  1.7822e-06 4.2975e-109 4.8374e-181
f6 mean  1.4687e-03  1.7225e-04  1.2769e-04  3.6728e-04  2.9271e-05
f6 std   1.3573e-03  1.2539e-04  1.2677e-04  3.7392e-05  3.2795e-05
f6 best  2.6874e-04  7.1783e-05  2.5723e-05  1.5973e-05  5.3764e-06
f7 mean  2.1733e-09           0  4.3651e-12  1.8327e-45           0
f7 std   4.2734e-08           0  5.7532e-13  4.3687e-46           0
f7 best           0           0           0           0           0
f8 mean  1.2764e-13  3.9763e-15  2.3715e-14  3.7941e-18           0
f8 std   1.4791e-14  5.7219e-15  3.7912e-15  2.7646e-18           0
f8 best  2.5794e-14  2.4564e-16  1.3741e-14           0           0
f9 mean  3.7911e-04           0  7.7497e-04           0           0
f9 std   2.3257e-03           0  5.4259e-04           0           0
f9 best           0           0  2.7491e-05           0           0
"""


@dataclass(frozen=True, slots=True)
class Printed:
    """Mean, standard deviation and best of 50 runs, as printed."""

    mean: float
    std: float
    best: float

    @property
    def fault(self) -> str:
        """The reason why no 50 values, none negative, can have these three numbers; empty if some can."""
        if self.mean < self.best:
            return "the mean is below the best"
        # One value is mean − best below the mean; the spread is least if the other values make up for it evenly.
        if self.std < 0.999 * (self.mean - self.best) / math.sqrt(RUNS - 1):
            return "the spread is too small for this mean and best"
        # The spread is largest if one value holds the whole sum.
        if self.std > 1.001 * self.mean * math.sqrt(RUNS):
            return "the spread is too large for this mean"
        return ""


def _read() -> dict[tuple[str, str], Printed]:
    numbers = {(row[0], row[1]): row[2:] for row in map(str.split, _TABLE_2.strip().splitlines())}
    return {
        (function, wolf): Printed(*(float(numbers[function, what][k]) for what in ("mean", "std", "best")))
        for function, _ in numbers
        for k, wolf in enumerate(WOLVES)
    }


PRINTED = _read()
