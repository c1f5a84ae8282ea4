"""What a run costs whatever the machine: steps of paths, diffusions, executions, pictures and memory."""

from __future__ import annotations

import math
import tracemalloc
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersModeling import vtkLinearSubdivisionFilter

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.bones import contact
from vtkmuscle.core.paths import pose
from vtkmuscle.core.skinning import diffusion
from vtkmuscle.data.arrays import blocks_of, multiblock_from
from vtkmuscle.filters import FixedPointDetector
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.pipelines import deform
from vtkmuscle.plotting import Studio, View, views
from vtkmuscle.plotting.studio import FINER
from vtkmuscle.run import result_data

#: Frames of the run.
FRAMES = 6


@contextmanager
def counted(counts: Counter[str]) -> Iterator[None]:
    """Count steps of paths, diffusions, collision passes, and executions of filters."""
    watched = (
        ("steps of Newton's method", pose.SheetPose, "step"),
        ("diffusions", diffusion.Diffusion, "spread"),
        ("collision passes", contact.PoseContact, "keep_out"),
        ("executions", Filter, "RequestData"),
    )
    with ExitStack() as stack:
        for what, owner, name in watched:
            stack.enter_context(patch.object(owner, name, _counting(getattr(owner, name), what, counts)))
        yield


def work() -> dict[str, int]:
    """Return how often what is done in a run of a small scene."""
    scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=10)
    found: Counter[str] = Counter()
    with counted(found):
        scene.run(frames=slice(0, FRAMES), figures=False, workers=1)
    return dict(sorted(found.items()))


def drawing() -> dict[str, int]:
    """Return what the figures and the page of a run of a small scene with fine bones take.

    Windows, pictures in them, triangles and thousands of pixels rendered for these; bones made coarser, and
    how often moment arms are taken.
    """
    phantom = phantoms.spindle_over_hinge()
    bones = {name: _refined(bone) for name, bone in blocks_of(phantom.bones)}
    scene = Scene.from_phantom(replace(phantom, bones=multiblock_from(bones)), n_fibres=10)
    found: Counter[str] = Counter()
    with ExitStack() as stack:
        watched = (
            ("bones made coarser", views, "clustered"),
            ("windows opened", Studio, "__init__"),
            ("moment arms of muscles", result_data, "joint_arms"),
        )
        for what, owner, name in watched:
            stack.enter_context(patch.object(owner, name, _counting(getattr(owner, name), what, found)))
        take = Studio.picture

        def picture(self: Studio, actors: Any, view: View, **options: Any) -> Any:
            image = take(self, actors, view, **options)
            found["pictures"] += 1
            found["triangles drawn"] += sum(one.GetMapper().GetInput().GetNumberOfPolys() for one in actors)
            bones = options.get("bones")
            of_bones = () if bones is None else bones.by_name.values()
            found["triangles drawn"] += sum(len(bone.triangles) for bone in of_bones)
            found["thousands of pixels drawn"] += FINER**2 * view.size[0] * view.size[1] // 1000
            return image

        stack.enter_context(patch.object(Studio, "picture", picture))
        folder = Path(stack.enter_context(TemporaryDirectory()))
        made = scene.run(folder / "out", frames=slice(0, FRAMES), figures=False, workers=1)
        made.write_figures(folder / "figures")  # by this process, which counts
    return dict(sorted(found.items()))


def _refined(bone: vtkPolyData) -> vtkPolyData:
    """Return a bone with so many triangles that two of them are drawn with fewer."""
    finer = vtkLinearSubdivisionFilter()
    finer.SetInputData(bone)
    finer.SetNumberOfSubdivisions(math.ceil(math.log(views.TRIANGLES / bone.GetNumberOfCells(), 4)))
    finer.Update()
    found: vtkPolyData = finer.GetOutput()
    return found


def _counting(original: Any, what: str, counts: Counter[str]) -> Any:
    """Return what does the same and is counted; executions by the class of what is executed."""

    def run(*arguments: Any, **keywords: Any) -> Any:
        counts[what if what != "executions" else f"executions of {type(arguments[0]).__name__}"] += 1
        return original(*arguments, **keywords)

    return run


def memory() -> int:
    """Return the most memory of a step [bytes per point], once all that is kept is there."""
    phantom = phantoms.spindle_over_hinge()
    (name, muscle), *_ = phantom.muscles.items()
    marked = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    chain = deform(marked, phantom.bones, phantom.motion, fixing=None)
    chain.update(time=float(phantom.motion.times[2]))
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    chain.update(time=float(phantom.motion.times[3]))
    peak = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    return int(peak // muscle.GetNumberOfPoints())


def counts() -> dict[str, int]:
    """Return all of it."""
    return {**work(), **drawing(), "bytes per point of a step": memory()}
