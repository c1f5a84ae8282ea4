"""The study: a converged reference, all settings against it, tables and plots."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.sense import check_sense
from vtkmuscle.tradeoff.measures import measured
from vtkmuscle.tradeoff.records import Records
from vtkmuscle.tradeoff.settings import Setting, grid, reference
from vtkmuscle.tradeoff.trial import Trial, tried

#: Rounds of the first reference; they are doubled for each muscle until it no longer moves.
FIRST_ITERATIONS = 20
MOST_ITERATIONS = 160
#: The reference of a muscle has converged when doubling its iterations moves it by no more, RMS [mm].
CONVERGED = 0.05
#: Every fifth frame is compared, and the last, unless frames are chosen.
COMPARED_EVERY = 5


@dataclass(frozen=True, eq=False)
class Row:
    """A setting and what was measured of it."""

    setting: Setting
    figures: Mapping[str, Any]


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
    fresh: bool = False,
    announce: Callable[[str], None] = lambda words: None,
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
    fresh : bool, optional
        Run settings again that are finished in the folder.
    announce : callable, optional
        Called with a line of text for each thing that is done.

    Returns
    -------
    Study
        What was measured.

    Raises
    ------
    ValueError
        If there is no such muscle or no such setting; the message lists what there is. If the scene's model
        is ``"paths"``, or a muscle fails in the reference run.
    """
    if scene.model == "paths":
        raise ValueError("the scene's model is 'paths', which has no settings to try; use model = \"volume\"")
    check_sense(scene)
    names = _known("muscle", muscles, list(scene.muscles))
    settings = chosen(grid(), only)
    last = len(scene.motion.times) - 1
    frames = sorted({*range(0, last + 1, COMPARED_EVERY), last}) if compared is None else sorted(compared)
    records = Records(out / "settings", scene, frames, fresh=fresh)

    def run(setting: Setting, muscles: Sequence[str], **more: Any) -> dict[str, Trial | None]:
        return tried(scene, setting, frames, muscles, **more)

    exact, doublings = _reference(run, names, records, announce)
    iterations = {doubling.muscle: doubling.iterations for doubling in doublings}
    rows = []
    for number, setting in enumerate(settings):

        def figures(setting: Setting = setting, number: int = number) -> dict[str, Any]:
            announce(f"{number + 1} of {len(settings)}: {setting.name}")
            return measured(run(setting, names), exact)

        rows.append(Row(setting, records.figures([setting.plain(), names, iterations], figures)))
    rows.append(Row(reference(max(iterations.values())), measured(exact, exact)))
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
    run: Callable[..., dict[str, Trial | None]],
    names: Sequence[str],
    records: Records,
    announce: Callable[[str], None],
) -> tuple[dict[str, Trial], list[Doubling]]:
    """Double each muscle's iterations until it stays where it is; return the last runs, and the last steps.

    All muscles that have not converged are run together; where muscles may meet, the others as they are by
    then.
    """
    iterations = dict.fromkeys(names, FIRST_ITERATIONS)

    def trials_of(muscles: Sequence[str]) -> dict[str, Trial]:
        setting, made = reference(max(iterations.values())), dict[str, Trial | None]()

        def make(name: str) -> Trial:
            if name not in made:
                announce(f"reference: {', '.join(f'{other} {iterations[other]}' for other in muscles)}")
                made.update(run(setting, muscles, iterations=iterations))
            trial = made[name]
            if trial is None:
                raise ValueError(
                    f"{name} failed in the reference run, so that nothing can be compared with it"
                )
            return trial

        key = [setting.plain(), list(muscles), dict(iterations)]
        return {name: records.trial([*key, name], partial(make, name)) for name in muscles}

    exact, doublings, moving = trials_of(names), dict[str, Doubling](), list(names)
    while moving:
        iterations |= {name: 2 * iterations[name] for name in moving}
        now = trials_of(moving)
        for name, trial in now.items():
            moved = measured({name: trial}, exact)["all"]
            doublings[name] = Doubling(name, iterations[name], moved["rms_mm"], moved["max_mm"])
            announce(in_words(doublings[name]))
        exact |= now
        settled = [name for name in moving if doublings[name].converged]
        moving = [n for n in moving if n not in settled and iterations[n] < MOST_ITERATIONS]
    return exact, [doublings[name] for name in names]


def in_words(doubling: Doubling) -> str:
    """Return what a doubling says of the reference."""
    return (
        f"{doubling.muscle}: {doubling.iterations} iterations instead of {doubling.iterations // 2} move the "
        f"reference by {doubling.rms_mm:.3f} mm (RMS), {doubling.max_mm:.3f} mm at most"
    )
