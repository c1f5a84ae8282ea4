"""Kohout et al. 2012, Figs. 13 and 14: fibres in moving muscles, made anew in each frame, and the time.

They take four muscles of the thigh in a walk, which the data set lacks; here it is the muscles of the hip
in flexion, with 50 parallel fibres of 14 segments each. Beside it: the fibres made once and carried along
(Kohout and Červenka 2021, eq. 8). Times are processor time, all threads together.
"""

from __future__ import annotations

import time
import warnings
from functools import partial
from typing import Any

import numpy as np
import pyvista as pv
from common import PATHS, Case, Table, main, picture

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import points_of, polylines_of
from vtkmuscle.data.attachments import AttachmentArea, attachments_from
from vtkmuscle.filters import FibreTransport
from vtkmuscle.pipelines import decompose

FIBRES = {"template": "parallel", "n_fibres": 50, "resolution": 14}
PUBLISHED = 300.0
ROUNDS = 3


def moved_areas(case: Case, name: str, degrees: float) -> Any:
    """Return a muscle's attachment areas where the bones have carried them."""
    now = case.motion.at(float(case.motion.times[round(degrees / 2.0)]))
    areas = [
        AttachmentArea(
            area.role,
            area.bone,
            apply_transform(now.get(area.bone, np.eye(4)), area.landmarks),
            closed=area.closed,
        )
        for area in case.scene.muscles[name].attachments
    ]
    return attachments_from(areas)


def least(run: Any) -> float:
    """Return the least time of some runs [ms]; each is given a new copy of its surface."""
    best = np.inf
    for _ in range(ROUNDS):
        begin = time.process_time()
        run()
        best = min(best, 1e3 * (time.process_time() - begin))
    return best


def tables(case: Case) -> list[Table]:
    """Return time and lengths per frame."""
    columns = (
        "flexion",
        "published, 4 muscles [ms]",
        "as published, made anew [ms]",
        "defaults, made anew [ms]",
    )
    columns += ("carried along [ms]", "mean lengths: as published / defaults / carried [mm]")
    table = Table(f"Figs. 13 and 14: 50 fibres of 14 segments, {len(case.muscles)} muscles", columns)
    chains = {name: case.chain(name, PATHS) for name in case.muscles}
    at_rest = {
        name: decompose(case.scene.muscles[name].surface, case.scene.attachments_data(name), **FIBRES)
        .update()
        .output
        for name in case.muscles
    }
    transports = {}
    row = []
    for degrees in (0.0, 2.0) if case.short else (0.0, 30.0, 60.0, 90.0):
        anew, carried, lengths, shown = np.zeros(2), 0.0, [[], [], []], []
        for name, chain in chains.items():
            pose = chain.pose(degrees)
            assert pose is not None
            bones, muscle = pose
            areas = moved_areas(case, name, degrees)

            def make(muscle: Any = muscle, areas: Any = areas, **published: str) -> Any:
                chain = decompose(muscle.copy(), areas, **published, **FIBRES)
                with warnings.catch_warnings():  # mean value maps warn of points outside
                    warnings.simplefilter("ignore")
                    return pv.wrap(chain.update().output).copy()

            printed = partial(make, published="kohout2012")
            anew += least(printed), least(make)
            fibres = make()
            if name not in transports:
                transports[name] = FibreTransport()
                transports[name](at_rest[name], chain.fixed, muscle)  # the weights, once
            transport = transports[name]
            carried += least(lambda t=transport, n=name, c=chain, m=muscle: t(at_rest[n], c.fixed, m.copy()))
            along = transport(at_rest[name], chain.fixed, muscle)
            for found, made in zip(lengths, (printed(), fibres, along), strict=True):
                lines = polylines_of(made, name)
                found += list(polyline_lengths(lines.points, lines.offsets) * case.scene.millimetres)
            shown.append((muscle, pv.wrap(fibres).copy()))
        means = " / ".join(f"{np.mean(found):.1f}" for found in lengths)
        table.add(f"{degrees:g}", f"{PUBLISHED:g}", *(f"{ms:.0f}" for ms in anew), f"{carried:.0f}", means)
        if case.draws:
            together = pv.merge([fibres for _, fibres in shown])
            lines = pv.PolyData(points_of(together), lines=together.lines)
            row.append((f"{degrees:g} degrees", picture(bones, [m for m, _ in shown], fibres=lines)))
    if case.draws:
        case.draw("kohout2012_fig13_14.png", [row])
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
