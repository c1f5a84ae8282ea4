"""What was published, in terms of this project."""

from __future__ import annotations

from typing import Any

#: The settings of P21; its number of iterations differs between experiments.
P21: dict[str, Any] = {
    "anisotropy": "stiffness",
    "start": "inertial",
    "solver": "gauss-seidel",
    "order": "sequential",
    "collision": "voxel",
    "bone_push": "transform",
    "contact_velocity": "keep",
}
