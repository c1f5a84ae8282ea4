"""What a run costs whatever the machine: projections, collision passes, executions of filters, and memory."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.collision import contact
from vtkmuscle.core.pbd import orders
from vtkmuscle.filters import FixedPointDetector
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.pipelines import deform

#: Frames of the run.
FRAMES = 6


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
    """Return both."""
    return {**work(), "bytes per point of a step": memory()}
