"""Groups of PBDDeformer's parameters: the published ones, and points of speed against accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX

#: Algorithm 2 of Kohout, Cervenka 2021, doi:10.1007/978-3-030-72379-8_24, as printed, with the settings of
#: its section 4; the number of iterations differs between its experiments.
PUBLISHED: Mapping[str, Any] = MappingProxyType(
    {
        "anisotropy": "stiffness",
        "prediction": "inertial",
        "solver": "gauss-seidel",
        "projection_order": "sequential",
        "collision": "voxel",
        "bone_push": "transform",
        "contact_velocity": "keep",
        "substeps": 1,
        "velocity_kept": 0.99,
        "stiffness": 1.0,
        "shape_stiffness": 0.9,
        "volume_stiffness": 1.0,
        "n_voxels": DEFAULT_N_MAX,
    }
)

#: Groups of PBDDeformer's parameters. The first three are tolerances, and the most iterations for them. Over
#: three steps of 10 degrees of hip flexion from rest: RMS distance to the end of the solve (a tolerance of
#: 0.0001 mm) in the worst frame, and iterations.
#:
#: ========  ==========================  =======================
#: preset    phantom hip, three muscles  real hip, four muscles
#: ========  ==========================  =======================
#: preview   0.17 mm, 4 to 7             0.21 mm, 4 to 12
#: balanced  0.083 mm, 6 to 11           0.080 mm, 6 to 20
#: accurate  0.027 mm, 9 to 16           0.029 mm, 10 to 31
#: ========  ==========================  =======================
#:
#: The time of a step is the same within what a busy machine lets one measure: strings, bones and report cost
#: more than the iterations. ``vtkmuscle tradeoff SCENE --every 5 --frames 0:4 --only presets --out FOLDER``
#: prints the like, with a reference whose iterations are doubled until the muscle stays where it is; the
#: figures above were measured by three steps of PBDDeformer itself.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"iterations": 30, "tolerance": 0.5},
        "balanced": {"iterations": 60, "tolerance": 0.15},
        "accurate": {"iterations": 200, "tolerance": 0.05},
        "published": PUBLISHED,
    }
)
