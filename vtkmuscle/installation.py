"""A test of an installation: known answers of three phantoms, and the versions of what is installed."""

import platform
from collections.abc import Iterator
from typing import Any

from vtkmuscle.core.jit import kernel_folder
from vtkmuscle.core.machine import processors
from vtkmuscle.core.types import SAME
from vtkmuscle.phantoms import pennate_block, spindle_over_hinge, wrapping_cylinder
from vtkmuscle.plotting import can_render
from vtkmuscle.run.report_values import version_of
from vtkmuscle.run.table import Table
from vtkmuscle.scenes import Scene

#: Packages of which a report of a problem needs the version; the last ones are optional.
PACKAGES = ("numpy", "scipy", "numba", "vtk", "pyvista", "opensim", "mujoco", "SimpleITK", "distributed")
#: Columns of the table.
COLUMNS = ("quantity", "measured", "known", "within", "passed")
#: Fibres of each phantom: enough for a mean within the bounds.
N_FIBRES = 16
#: Bound of a moment arm [mm]: the largest error of these phantoms at these poses is 1.2.
ARM_ERROR = 2.0
#: Bound of a straight fibre's length [mm] and pennation [degrees]: the surface has single precision.
FIBRE_ERROR = 1e-3


def selftest() -> Table:
    """Compare what the installed package computes with known answers.

    Returns
    -------
    Table
        A row per quantity: measured and known value, the allowed difference, and whether the value passed.

    Examples
    --------
    >>> import vtkmuscle
    >>> bool(vtkmuscle.selftest()["passed"].all())
    True
    """
    return Table(COLUMNS, [(*row, abs(row[1] - row[2]) <= row[3]) for row in _measured()])


def _measured() -> Iterator[tuple[str, float, float, float]]:
    """Yield quantity, measured and known value, and allowed difference."""
    for phantom, name in ((spindle_over_hinge(), "spindle"), (wrapping_cylinder(), "strap")):
        result = Scene.from_phantom(phantom, n_fibres=N_FIBRES).run(frames="0:9:4")
        (arms,) = result[name].moment_arms.values()
        answer: Any = phantom.known["moment_arm"]
        expected = answer(float(arms.values[-1])) if callable(answer) else answer
        quantity = f"{phantom.name}: mean moment arm at {arms.values[-1]:g} {arms.unit} [mm]"
        yield quantity, float(arms.mean[-1]), expected, ARM_ERROR
    scene = Scene.from_phantom(spindle_over_hinge(), n_fibres=N_FIBRES)
    ratio = scene.run(deformer="pbd", frames="0:6").report["muscles"]["spindle"]["frames"][-1]["volume_ratio"]
    yield "spindle_over_hinge by PBD: volume / at rest", ratio, 1.0, SAME
    block = pennate_block()
    known_block: Any = block.known
    architecture = Scene.from_phantom(block, n_fibres=N_FIBRES).run(frames="0")["block"].architecture
    keys = "fascicle_length_mm", "fascicle_pennation_origin_deg"
    length, angle = (architecture[key]["mean"] for key in keys)
    yield "pennate_block: mean fibre length [mm]", length, known_block["fibre_length"], FIBRE_ERROR
    yield "pennate_block: mean pennation [degrees]", angle, known_block["pennation"], FIBRE_ERROR


def installation() -> dict[str, str]:
    """Return what a report of a problem needs: versions, processors, pictures and cached kernels."""
    facts = {"python": f"{platform.python_version()}, {platform.platform()}", "processors": str(processors())}
    facts |= {package: version_of(package, "not installed") for package in ("vtkmuscle", *PACKAGES)}
    facts["pictures"] = can_render() or "can be rendered"
    facts["kernels"] = str(kernel_folder() or "not cached")
    return facts
