"""The study: a converged reference, all settings against it, tables and plots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vtkmuscle.scene.model import Scene
from vtkmuscle.tradeoff.measures import measured
from vtkmuscle.tradeoff.records import Records
from vtkmuscle.tradeoff.settings import Setting, grid, reference
from vtkmuscle.tradeoff.trial import Bench, Trial

#: Iterations of the first reference; they are doubled until the muscles no longer move.
FIRST_ITERATIONS = 400
MOST_ITERATIONS = 6400
#: The reference has converged when doubling its iterations moves no muscle by more than this, RMS [mm].
CONVERGED = 0.05
#: Frames that are compared, unless they are chosen: each so manieth, and the last.
COMPARED_EVERY = 5


@dataclass(frozen=True, eq=False)
class Row:
    """A setting and what was measured of it."""

    setting: Setting
    figures: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Doubling:
    """How far the reference moved when its iterations were doubled.

    Attributes
    ----------
    iterations : int
        After the doubling.
    rms_mm, max_mm : float
        Distance to the one before: of the muscle where it is greatest, and of the point.
    """

    iterations: int
    rms_mm: float
    max_mm: float

    @property
    def converged(self) -> bool:
        """Whether it hardly moved."""
        return self.rms_mm <= CONVERGED


@dataclass(frozen=True, eq=False)
class Study:
    """What came out.

    Attributes
    ----------
    scene : str
        Name of the scene.
    muscles : sequence of str
        Those that took part.
    doublings : sequence of Doubling
        How the reference converged.
    rows : sequence of Row
        In the order of the grid, the reference last.
    """

    scene: str
    muscles: Sequence[str]
    doublings: Sequence[Doubling]
    rows: Sequence[Row]


def trade_off(
    scene: Scene,
    out: Path,
    *,
    only: Sequence[str] = (),
    muscles: Sequence[str] = (),
    compared: Sequence[int] | None = None,
    tell: Callable[[str], None] = lambda words: None,
) -> Study:
    """Run a scene with many settings, and compare each with a converged run of the scene.

    Settings that are finished in the folder are not run again. The table and the plots are written by
    :func:`~vtkmuscle.tradeoff.table.write_tables` and :func:`~vtkmuscle.tradeoff.plots.write_plots`.

    Parameters
    ----------
    scene : Scene
        What is run. The settings tried take the place of its own of the same name.
    out : Path
        Folder for the finished settings, in ``settings``.
    only : sequence of str, optional
        Groups or beginnings of names of the settings to try, e.g. ``"presets"`` or ``"iterations"``; all by
        default.
    muscles : sequence of str, optional
        Which muscles; all by default.
    compared : sequence of int, optional
        Numbers of the frames to compare; each fifth and the last by default. Frames up to the last of them
        are computed.
    tell : callable, optional
        Told in words what is being done.

    Returns
    -------
    Study
        What was measured.

    Raises
    ------
    ValueError
        If there is no such muscle or no such setting; the message lists what there is.
    """
    names = _known("muscle", muscles, list(scene.muscles))
    settings = chosen(grid(), only)
    last = len(scene.motion.times) - 1
    frames = sorted({*range(0, last + 1, COMPARED_EVERY), last}) if compared is None else sorted(compared)
    records = Records(out / "settings", scene, names, frames)
    bench = Bench(scene, names, frames, tell)
    against, exact, doublings = _reference(bench, records, tell)
    rows = []
    for number, setting in enumerate([*settings, against]):
        figures = records.figures(setting, against)
        if figures is None:
            tell(f"{number + 1} of {len(settings) + 1}: {setting.name}")
            trial = exact if setting is against else bench.run(setting)
            figures = measured(trial, exact)
            records.keep_figures(setting, against, figures)
        rows.append(Row(setting, figures))
    return Study(scene.name, names, doublings, rows)


def chosen(settings: Sequence[Setting], only: Sequence[str]) -> list[Setting]:
    """Return the settings whose group or beginning of the name is wanted, all where nothing is."""
    if not only:
        return list(settings)
    for word in only:
        if not any(_wanted(setting, word) for setting in settings):
            groups = ", ".join(dict.fromkeys(setting.group for setting in settings))
            raise ValueError(f"no setting is called {word!r}; there are groups {groups}")
    return [setting for setting in settings if any(_wanted(setting, word) for word in only)]


def _wanted(setting: Setting, word: str) -> bool:
    return setting.group == word or setting.name.startswith(word)


def _known(kind: str, wanted: Sequence[str], known: Sequence[str]) -> list[str]:
    for name in wanted:
        if name not in known:
            raise ValueError(f"there is no {kind} {name!r}; there are {', '.join(known)}")
    return [name for name in known if not wanted or name in wanted]


def _reference(
    bench: Bench, records: Records, tell: Callable[[str], None]
) -> tuple[Setting, Trial, list[Doubling]]:
    """Double the iterations until the muscles stay where they are; return the last run, and the way there."""

    def run(setting: Setting) -> Trial:
        trial = records.trial(setting)
        if trial is None:
            trial = bench.run(setting)
            records.keep_trial(setting, trial)
        return trial

    setting = reference(FIRST_ITERATIONS)
    trial = run(setting)
    doublings: list[Doubling] = []
    while not (doublings and doublings[-1].converged) and setting.solver["iterations"] < MOST_ITERATIONS:
        before = trial
        setting = reference(2 * setting.solver["iterations"])
        trial = run(setting)
        moved = measured(before, trial)["all"]
        doublings.append(Doubling(setting.solver["iterations"], moved["worst_rms_mm"], moved["max_mm"]))
        tell(in_words(doublings[-1]))
    return setting, trial, doublings


def in_words(doubling: Doubling) -> str:
    """Return what a doubling says of the reference."""
    return (
        f"{doubling.iterations} iterations instead of {doubling.iterations // 2} move the reference by "
        f"{doubling.rms_mm:.3f} mm (RMS, worst muscle), {doubling.max_mm:.3f} mm at most"
    )
