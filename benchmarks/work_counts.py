"""What a run costs whatever the machine: projections, collision passes, executions of filters, and memory.

Of a decomposition and of a transport it is what their kernels are given: points whose nearest place on a
surface is looked for, positions by which fibres are spread, sections that are mapped, weights.
"""

from __future__ import annotations

import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.collision import contact
from vtkmuscle.core.fibres import mean_value, sparse_weights, spreading
from vtkmuscle.core.mesh import triangle_tree
from vtkmuscle.core.morphing import slices
from vtkmuscle.core.pbd import orders
from vtkmuscle.filters import FibreTransport, FixedPointDetector
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.pipelines import decompose, deform

#: Frames of the run.
FRAMES = 6
#: What counts of fibres' kernels end with.
OF_FIBRES = ("of a decomposition", "of a transport")


@contextmanager
def counted(counts: Counter[str]) -> Iterator[None]:
    """Count projections, collision passes, and executions of filters."""
    watched = (
        ("projections", orders.ColourOrder, "project"),
        ("collision passes", contact.Contact, "keep_out"),
        ("executions", Filter, "RequestData"),
    )
    originals = [getattr(owner, name) for _, owner, name in watched]

    def counting(original: Any, what: str) -> Any:
        def run(self: Any, *arguments: Any, **keywords: Any) -> Any:
            counts[what if what != "executions" else f"executions of {type(self).__name__}"] += 1
            return original(self, *arguments, **keywords)

        return run

    for (what, owner, name), original in zip(watched, originals, strict=True):
        setattr(owner, name, counting(original, what))
    try:
        yield
    finally:
        for (_, owner, name), original in zip(watched, originals, strict=True):
            setattr(owner, name, original)


def work() -> dict[str, int]:
    """Return how often what is done in a run of a small scene."""
    scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=10)
    found: Counter[str] = Counter()
    with counted(found):
        scene.run(frames=slice(0, FRAMES), figures=False, workers=1)
    return dict(sorted(found.items()))


@contextmanager
def given(counts: Counter[str], suffix: str) -> Iterator[None]:
    """Count what kernels of fibres are given."""
    watched: tuple[tuple[str, Any, str, Callable[..., int]], ...] = (
        ("nearest places", triangle_tree, "_nearest", lambda _, queries: len(queries)),
        ("positions", spreading, "_pulls", lambda _, __, samples, *___: len(samples)),
        ("sections mapped", slices, "section_map", lambda *_, **__: 1),
        ("triangles seen", mean_value, "weights_of_lanes", lambda mesh, q, *_: len(q) * len(mesh.triangles)),
        ("weights", sparse_weights, "_apply", lambda _, __, values, *___: len(values)),
    )

    def counting(original: Any, what: str, size: Callable[..., int]) -> Any:
        def run(*arguments: Any, **keywords: Any) -> Any:
            counts[f"{what} {suffix}"] += size(*arguments, **keywords)
            return original(*arguments, **keywords)

        return run

    originals = [getattr(owner, name) for _, owner, name, _ in watched]
    for (what, owner, name, size), original in zip(watched, originals, strict=True):
        counts[f"{what} {suffix}"] = 0
        setattr(owner, name, counting(original, what, size))
    try:
        yield
    finally:
        for (_, owner, name, _), original in zip(watched, originals, strict=True):
            setattr(owner, name, original)


def fibre_work() -> dict[str, int]:
    """Return what is done for 100 fibres in a muscle that had others, and for weights and a frame of them."""
    phantom = phantoms.spindle_over_hinge()
    ((name, muscle),) = phantom.muscles.items()
    areas = phantom.attachments[name]
    marked = FixedPointDetector()(muscle, phantom.bones, areas)
    decompose(muscle, areas, n_fibres=110).update()
    found: Counter[str] = Counter()
    with given(found, OF_FIBRES[0]):
        fibres = decompose(muscle, areas, n_fibres=100).update().output
    with given(found, OF_FIBRES[1]):
        FibreTransport(weight_tolerance=0.3)(fibres, marked, muscle)
    return dict(sorted(found.items()))


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
    """Return all of them."""
    return {**work(), **fibre_work(), "bytes per point of a step": memory()}
