"""Groups of PBDDeformer's parameters: the published ones, and points of speed against accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX
from vtkmuscle.core.taut.paths import POINTS

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

#: Groups of PBDDeformer's parameters. The first three are tolerances, the most iterations for them, and
#: segments of taut fibres. Over three steps of 10 degrees of hip flexion from rest: RMS distance, in the
#: worst frame, to the end of the solve with the fibres of ``balanced``; time of a frame, of that of it.
#:
#: ========  ==========================  =======================
#: preset    phantom hip, three muscles  real hip, four muscles
#: ========  ==========================  =======================
#: preview   0.19 mm, 0.66               0.35 mm, 0.75
#: balanced  0.056 mm, 1                 0.059 mm, 1
#: accurate  0.024 mm, 1.13              0.021 mm, 1.11
#: ========  ==========================  =======================
#:
#: ``vtkmuscle tradeoff SCENE --every 5 --frames 0:4 --only presets --out FOLDER``. ``taut_resolution=64``
#: moves muscles by another 0.15 mm on the phantom and 0.30 mm on the real hip, at three times the time.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"iterations": 10, "tolerance": 0.5, "taut_resolution": 24},
        "balanced": {"iterations": 60, "tolerance": 0.15, "taut_resolution": POINTS - 1},
        "accurate": {"iterations": 200, "tolerance": 0.05, "taut_resolution": POINTS - 1},
        "published": PUBLISHED,
    }
)
