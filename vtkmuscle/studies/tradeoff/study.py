"""A converged reference, and all settings against it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

from vtkmuscle.run.table import Table
from vtkmuscle.scene.sense import check_sense
from vtkmuscle.scenes import Scene
from vtkmuscle.studies.case import Case
from vtkmuscle.studies.outcome import Outcome
from vtkmuscle.studies.study import PARTS, Progress, claimed, outcome_of, study
from vtkmuscle.studies.tradeoff.measures import MEASURES, measured, together
from vtkmuscle.studies.tradeoff.settings import chosen, grid, reference
from vtkmuscle.studies.variation import Variation

#: Rounds of the first reference; they are doubled for each muscle until it no longer moves.
FIRST_ITERATIONS = 20
MOST_ITERATIONS = 160
#: The reference of a muscle has converged when doubling its iterations moves it by no more, RMS [mm].
CONVERGED = 0.05
#: Every fifth frame is compared, and the last, unless frames are chosen.
COMPARED_EVERY = 5

#: Columns of the table that say what was tried.
_WHAT = ("muscle", "group", "setting")


@dataclass(frozen=True, eq=False)
class Doubling:
    """How far the reference of a muscle moved when its iterations were doubled.

    Attributes
    ----------
    muscle : str
        Which.
    iterations : int
        After the doubling.
    rms_mm, max_mm : float
        Distance to the one before: of the muscle, and of its point where it is greatest.
    """

    muscle: str
    iterations: int
    rms_mm: float
    max_mm: float

    @property
    def converged(self) -> bool:
        """Whether it hardly moved."""
        return self.rms_mm <= CONVERGED

    def __str__(self) -> str:
        return (
            f"{self.muscle}: {self.iterations} iterations instead of {self.iterations // 2} move the "
            f"reference by {self.rms_mm:.3f} mm (RMS), {self.max_mm:.3f} mm at most"
        )


@dataclass(frozen=True, eq=False)
class TradeOff:
    """What came out.

    Attributes
    ----------
    scene : str
        Name of the scene.
    muscles : sequence of str
        Those that took part.
    doublings : sequence of Doubling
        The last of each muscle: how far its reference has converged.
    table : Table
        A row per setting for all muscles together (``muscle`` is ``"all"``), then one for each muscle; the
        reference last. Columns ``muscle``, ``group``, ``setting``, those of
        :data:`~vtkmuscle.studies.tradeoff.measures.MEASURES`, and ``message`` of what failed.
    """

    scene: str
    muscles: Sequence[str]
    doublings: Sequence[Doubling]
    table: Table


def trade_off(
    scene: Scene,
    out: Path,
    *,
    only: Sequence[str] = (),
    muscles: Sequence[str] = (),
    compared: Sequence[int] | None = None,
    fresh: bool = False,
    announce: Callable[[str], None] = lambda words: None,
) -> TradeOff:
    """Run a scene with many settings, and compare each with a converged run of the scene.

    Settings that are finished in the folder are not run again. The table, the page and the plots are written
    by :func:`~vtkmuscle.studies.tradeoff.page.write_trade_off`. Muscles run one after the other, by the
    processor's time.

    Parameters
    ----------
    scene : Scene
        What is run. The settings tried take the place of its own of the same name.
    out : Path
        Folder for what is finished, in ``parts``.
    only : sequence of str, optional
        Groups or beginnings of names of the settings to try, e.g. ``"presets"`` or ``"iterations"``; all by
        default.
    muscles : sequence of str, optional
        Which muscles; all by default.
    compared : sequence of int, optional
        Numbers of the frames to compare; each fifth and the last by default. Frames up to the last of them
        are computed.
    fresh : bool, optional
        Run settings again that are finished in the folder.
    announce : callable, optional
        Called with a line of text for each thing that is done.

    Raises
    ------
    ValueError
        If there is no such muscle or no such setting; the message lists what there is. If the scene's model
        is ``"paths"``, or a muscle fails in the reference run.
    """
    if scene.model == "paths":
        raise ValueError("the scene's model is 'paths', which has no settings to try; use model = \"volume\"")
    check_sense(scene)
    names = list((scene.with_muscles(*muscles) if muscles else scene).muscles)
    settings = chosen(grid(), tuple(only))
    last = len(scene.motion.times) - 1
    numbers = sorted({*range(0, last + 1, COMPARED_EVERY), last}) if compared is None else sorted(compared)
    times = tuple(float(scene.motion.times[number]) for number in numbers)
    whole = replace(scene, motion=scene.motion.part(range(numbers[-1] + 1)))
    folder = out / PARTS

    def case(setting: Variation, muscle: str) -> Case:
        return Case({"setting": setting.name}, muscle, whole, setting, points_at=times)

    def announced(one: Progress) -> None:
        announce(f"{one.done} of {one.total}: {one.case.variation.name}, {one.case.muscle}: {one.words}")

    def reference_run(muscle: str, iterations: int) -> Outcome:
        only_this = case(reference(iterations), muscle)
        announce(f"reference: {muscle} {iterations}")
        study([[only_this]], folder)
        return outcome_of(only_this, folder)

    exact, doublings = {}, []
    cases = [[case(setting, name) for name in names] for setting in settings]
    of = {"study_file": f"trade-off of {scene.files.get('', scene.name)}"}
    with claimed(out, of, ("tradeoff.csv", "tradeoff.html")):
        if fresh:
            study([], folder, fresh=True)
        for name in names:
            exact[name], doubling = converged(name, reference_run)
            doublings.append(doubling)
            announce(str(doubling))
        study(cases, folder, progress=announced)
        found = [{one.muscle: outcome_of(one, folder) for one in own} for own in cases]
    last_reference = Variation("reference", "reference")
    return TradeOff(scene.name, names, doublings, _table([*settings, last_reference], [*found, exact], exact))


def _table(
    settings: Sequence[Variation], found: Sequence[Mapping[str, Outcome]], exact: Mapping[str, Outcome]
) -> Table:
    """Return the table, of what came out of each setting by muscle."""
    rows: dict[str, list[tuple[Any, ...]]] = {name: [] for name in ("all", *exact)}
    for setting, outcomes in zip(settings, found, strict=True):
        figures = {name: measured(one, exact[name]) for name, one in outcomes.items()}
        for name, row in {"all": together(figures), **figures}.items():
            message = outcomes[name].message if name in outcomes else ""
            values = (row[measure.name] for measure in MEASURES)
            rows[name].append((name, setting.group, setting.name, *values, message))
    columns = (*_WHAT, *(measure.name for measure in MEASURES), "message")
    return Table(columns, chain.from_iterable(rows.values()))


def converged(muscle: str, run: Callable[[str, int], Outcome]) -> tuple[Outcome, Doubling]:
    """Double a muscle's iterations until it stays where it is; return the last run, and the last step."""
    iterations = FIRST_ITERATIONS
    exact = run(muscle, iterations)
    while True:
        iterations *= 2
        now = run(muscle, iterations)
        moved = measured(now, exact)
        rms, most = moved["rms_mm"], moved["max_mm"]
        if rms is None or most is None:
            why = now.failure or exact.failure or "it went astray"
            problem = f"{muscle} failed in the reference run, so that nothing can be compared with it: {why}"
            raise ValueError(problem)
        doubling = Doubling(muscle, iterations, rms, most)
        exact = now
        if doubling.converged or iterations >= MOST_ITERATIONS:
            return exact, doubling
