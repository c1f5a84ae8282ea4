"""The study: a converged reference, all settings against it, tables and plots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vtkmuscle.scene.data import SceneData
from vtkmuscle.tradeoff.measures import measured
from vtkmuscle.tradeoff.records import Records
from vtkmuscle.tradeoff.settings import Setting, grid, reference
from vtkmuscle.tradeoff.trial import Bench, Trial

#: Iterations of the first reference; they are doubled for each muscle until it no longer moves.
FIRST_ITERATIONS = 100
MOST_ITERATIONS = 800
#: The reference of a muscle has converged when doubling its iterations moves it by no more, RMS [mm].
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
        The last of each muscle: how far its reference has converged.
    rows : sequence of Row
        In the order of the grid, the reference last.
    """

    scene: str
    muscles: Sequence[str]
    doublings: Sequence[Doubling]
    rows: Sequence[Row]


def trade_off(
    scene: SceneData,
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
    scene : SceneData
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
    exact, doublings = _reference(bench, records, tell)
    against = {doubling.muscle: doubling.iterations for doubling in doublings}
    last_row = reference(max(against.values()))
    rows = []
    for number, setting in enumerate([*settings, last_row]):
        figures = records.figures(setting, against)
        if figures is None:
            tell(f"{number + 1} of {len(settings) + 1}: {setting.name}")
            trial = exact if setting is last_row else bench.run(setting)
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


def _reference(bench: Bench, records: Records, tell: Callable[[str], None]) -> tuple[Trial, list[Doubling]]:
    """Double each muscle's iterations until it stays where it is; return the last runs, and the last step."""

    def run(name: str, iterations: int) -> Trial:
        setting = reference(iterations)
        trial = records.trial(setting, name)
        if trial is None:
            trial = bench.run(setting, [name])
            records.keep_trial(setting, name, trial)
        return trial

    trials, doublings = [], []
    for name in bench.muscles:
        iterations, before = FIRST_ITERATIONS, run(name, FIRST_ITERATIONS)
        while True:
            iterations *= 2
            now = run(name, iterations)
            moved = measured(before, now)["all"]
            doubling = Doubling(name, iterations, moved["rms_mm"], moved["max_mm"])
            tell(in_words(doubling))
            before = now
            if doubling.converged or iterations >= MOST_ITERATIONS:
                break
        trials.append(now)
        doublings.append(doubling)
    memory = [trial.memory_mb for trial in trials if trial.memory_mb is not None]
    muscles = {name: muscle for trial in trials for name, muscle in trial.muscles.items()}
    return Trial(muscles, max(memory) if memory else None), doublings


def in_words(doubling: Doubling) -> str:
    """Return what a doubling says of the reference."""
    return (
        f"{doubling.muscle}: {doubling.iterations} iterations instead of {doubling.iterations // 2} move the "
        f"reference by {doubling.rms_mm:.3f} mm (RMS), {doubling.max_mm:.3f} mm at most"
    )
