"""What the kernels of a decomposition and of a transport are given, whatever the machine.

Points whose nearest place on a surface is looked for, positions by which fibres are spread, sections that are
mapped, triangles that points are seen from, weights.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from vtkmuscle import phantoms
from vtkmuscle.core.fibres import embedding, mean_value, spreading
from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.morphing import slices
from vtkmuscle.filters import FibreTransport, FixedPointDetector
from vtkmuscle.pipelines import decompose

#: What the names of counts end with.
OF_FIBRES = ("of a decomposition", "of a transport")


@contextmanager
def given(counts: Counter[str], suffix: str) -> Iterator[None]:
    """Count what kernels of fibres are given."""
    watched: tuple[tuple[str, Any, str, Callable[..., int]], ...] = (
        ("nearest places", TriangleTree, "nearest", lambda _, queries: len(queries)),
        ("positions", spreading, "_pulls", lambda _, __, within, *___: len(within.samples)),
        ("sections mapped", slices, "section_map", lambda *_, **__: 1),
        ("triangles seen", mean_value, "weights_of_lanes", lambda mesh, q, *_: len(q) * len(mesh.triangles)),
        ("weights", embedding, "sparse_transport", lambda weights, _: weights.matrix.nnz),
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
