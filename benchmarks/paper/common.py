"""What the scripts of the papers' experiments share: scene, models, steps, tables, pictures.

Each script has a function ``tables(case)`` and takes ``[--data real|phantom] [--out FOLDER] [--short]``.
Without ``--data`` the right hip of the LHDL data set is taken where it is (VTKMUSCLE_DATA), else the phantom
hip. Pictures are drawn only where a folder is given for them. ``--short`` leaves out what takes long.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vtkmuscle import RigidMotion, Scene, phantoms
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.mesh.surface import edge_lengths, mesh_topology
from vtkmuscle.data.arrays import checked_surface, field_array, points_of, polylines_of
from vtkmuscle.filters import FibreTransport, FixedPointDetector
from vtkmuscle.pipelines import MusclePipeline, decompose
from vtkmuscle.plotting import can_render, choose_view, make_plotter
from vtkmuscle.plotting.views import View
from vtkmuscle.run import muscle_pipeline

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from bench_pbd import naive_of
from real_hip import data_folder

Floats = NDArray[np.float64]

#: The muscles of the paper, in the order of its Table 2.
MUSCLES = ("gluteus_maximus", "adductor_brevis", "iliacus", "gluteus_medius")
#: Cells of the published voxels: as many as 64 along each axis, and its default.
EQUAL, FINE = 64**3, 8 * 64**3
#: The plain scalar kernels that bench_pbd.py takes, beside the data.
NAIVE = data_folder().parents[1] / "tools" / "naive.py"
#: A frame of hip flexion, in the paper and here [degrees].
STEP = 2.0


def curves(title: str, abscissa: str, ordinate: str) -> tuple[Figure, Axes]:
    """Return a figure and axes for curves."""
    figure = Figure(figsize=(7.0, 4.6), dpi=150, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set(title=title, xlabel=abscissa, ylabel=ordinate)
    return figure, axes


@dataclass
class Table:
    """Numbers with a heading; columns of the papers' values are called ``published``."""

    title: str
    columns: Sequence[str]
    rows: list[Sequence[object]] = field(default_factory=list)

    def add(self, *cells: object) -> None:
        """Add a row."""
        assert len(cells) == len(self.columns)
        self.rows.append(cells)

    def text(self) -> str:
        """Return it in columns of equal width."""
        lines = [[str(cell) for cell in row] for row in [self.columns, *self.rows]]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        body = ["  " + "  ".join(c.ljust(w) for c, w in zip(x, widths, strict=True)).rstrip() for x in lines]
        return "\n".join([self.title, *body])

    def rst(self) -> str:
        """Return it as a table for the documentation."""
        lines = [f".. list-table:: {self.title}", "   :header-rows: 1", ""]
        for row in [self.columns, *self.rows]:
            lines += [f"   {'  -' if i else '* -'} {cell}".rstrip() for i, cell in enumerate(row)]
        return "\n".join([*lines, ""])


#: The models that experiments compare: the deformer of a pipeline, and its settings. The number of iterations
#: of Kohout and Cervenka 2021 differs between their experiments.
PRINTED, STABLE, PATHS = "as printed", "stable", "default model"
MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    PRINTED: ("pbd", {"quality": "published"}),
    STABLE: ("pbd", {}),
    PATHS: ("paths", {}),
}


class Chain(MusclePipeline):
    """A muscle that follows its bones, with fixed points and fibres at rest as data.

    Position based dynamics has the fibres of the paper, carried by all weights (eq. 8), and no paths; the
    default model has its own fibres.
    """

    def __init__(
        self, case: Case, name: str, model: str, surface: Any, fixing: dict[str, Any], motion: RigidMotion
    ):
        deformer, settings = MODELS[model]
        bones, areas = case.scene.bones_data(), case.scene.attachments_data(name)
        fixed = FixedPointDetector(**fixing).apply(surface, bones, areas)
        fibres = case.fibres(name, model)
        super().__init__(fixed, bones, motion, areas, deformer=deformer, fibres=fibres, solver=settings)
        self.moved: Any = self.metrics
        if deformer == "pbd":
            self.moved = FibreTransport(
                rest_fibres=fibres, rest_muscle=fixed, deformed_muscle=self.deformer, weight_tolerance=0.0
            )
        self._times, self._millimetres = motion.times, case.scene.millimetres

    def at(self, degrees: float) -> Any:
        """Return the muscle so many degrees from rest; it changes with the next call."""
        assert self.deformer is not None
        return self.deformer.update(time=float(self._times[round(degrees / STEP)])).output

    def pose(self, degrees: float) -> tuple[Any, Any] | None:
        """Return bones and muscle so many degrees from rest, to be kept; None if it has left the numbers."""
        try:
            muscle = pv.wrap(self.at(degrees)).copy()
        except ValueError:
            return None
        return pv.wrap(self.moving.output).copy(), muscle

    def lengths(self, times: Sequence[float]) -> Floats:
        """Return fibre lengths (times, fibres) [mm], as far as the muscle stays among the numbers."""
        lengths = []
        for moment in times:
            try:
                lines = polylines_of(self.moved.update(time=float(moment)).output, "fibres")
            except ValueError:
                break
            lengths.append(polyline_lengths(lines.points, lines.offsets))
        return np.reshape(lengths, (-1, self.fibres.GetNumberOfCells())) * self._millimetres

    def step_time(self, degrees: Sequence[float]) -> tuple[float, float]:
        """Return the median time of a step [ms], and the same in plain iterations; call it once.

        A step is one update of the deformer, with all that is before it: bones, and paths where it has them.
        What is prepared once is left out: the first step is made before the clock runs. The clock is that of
        the processor, all threads together. In turns with the steps an iteration of plain scalar kernels runs
        on the same mesh, where these are (bench_pbd.py): its time tells how fast the machine is then. Steps
        end where a muscle leaves the range of numbers.
        """
        self.at(degrees[0])
        plain = plain_iteration(self.fixed)
        taken = []
        for angle in degrees[1:]:
            begin = time.process_time()
            plain()
            middle = time.process_time()
            try:
                self.at(angle)
            except ValueError:
                break
            taken.append((time.process_time() - middle, middle - begin))
        if not taken:
            return np.nan, np.nan
        step, unit = 1e3 * np.median(taken, axis=0)
        return float(step), float(step / unit)


def plain_iteration(muscle: Any) -> Callable[[], object]:
    """Return an iteration of plain scalar kernels on a muscle; nothing where these are not."""
    if not NAIVE.is_file():
        return lambda: None
    iterate: Callable[[], object] = naive_of(*checked_surface(muscle, "muscle"))
    iterate()  # compiles
    return iterate


@dataclass(frozen=True, eq=False)
class Case:
    """What an experiment is made on."""

    real: bool
    short: bool = False
    out: Path | None = None

    @cached_property
    def scene(self) -> Scene:
        """The hip."""
        if self.real:
            return Scene.load(data_folder() / "scene.toml")
        return Scene.from_phantom(phantoms.hip(), n_fibres=20 if self.short else 100)

    @cached_property
    def motion(self) -> RigidMotion:
        """Flexion from rest on, a frame every 2 degrees."""
        return self.scene.motion

    @cached_property
    def muscles(self) -> list[str]:
        """The muscles of the paper that the scene has."""
        return [name for name in MUSCLES if name in self.scene.muscles]

    @cached_property
    def adductor(self) -> str:
        """The adductor brevis; on the phantom, which has none, the gluteus medius."""
        return "adductor_brevis" if "adductor_brevis" in self.scene.muscles else "gluteus_medius"

    @cached_property
    def _fibres(self) -> dict[tuple[str, str | None], Any]:
        return {}

    def fibres(self, name: str, model: str = PATHS) -> Any:
        """Return the fibres of a muscle at rest: those of the scene, or 100 of 15 segments of the paper."""
        published = None if model == PATHS else "kohout2014"
        key = name, published
        if key not in self._fibres:
            fibres = muscle_pipeline(self.scene, name).fibres
            if published is not None:
                muscle, areas = self.scene.muscles[name].surface, self.scene.attachments_data(name)
                count = 20 if self.short else 100
                fibres = decompose(muscle, areas, published=published, n_fibres=count, resolution=15)
            with warnings.catch_warnings():  # mean value maps warn of points outside
                warnings.simplefilter("ignore")
                self._fibres[key] = pv.wrap(fibres.update().output).copy()
        return self._fibres[key]

    def chain(
        self,
        name: str,
        model: str,
        *,
        surface: Any = None,
        fixing: dict[str, Any] | None = None,
        motion: RigidMotion | None = None,
        **settings: Any,
    ) -> Chain:
        """Return a muscle that follows its bones by a model, with other settings of the deformer."""
        surface = self.scene.muscles[name].surface if surface is None else surface
        chain = Chain(self, name, model, surface, fixing or {}, motion or self.motion)
        for setting, setting_value in settings.items():
            setattr(chain.deformer, setting, setting_value)
        return chain

    def chains(self, name: str, iterations: int, **settings: Any) -> dict[str, Chain]:
        """Return a muscle by each model, with so many iterations where it is position based dynamics."""
        count = {"iterations": iterations}
        return {
            model: self.chain(name, model, **({} if model == PATHS else count), **settings)
            for model in MODELS
        }

    def draw(self, name: str, rows: Sequence[Sequence[tuple[str, NDArray[Any]]]]) -> None:
        """Write rows of titled pictures to the user's folder."""
        height = 3.4 * len(rows)
        figure = Figure(figsize=(3.2 * len(rows[0]), height), dpi=120, facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.subplots(len(rows), len(rows[0]), squeeze=False)
        for line, row in zip(axes, rows, strict=True):
            for axis, (title, pixels) in zip(line, row, strict=True):
                axis.imshow(pixels)
                axis.set_title(title, fontsize=8)
                axis.axis("off")
        figure.tight_layout()
        self.save(figure, name)

    def save(self, figure: Figure, name: str) -> None:
        """Write a figure to the user's folder."""
        assert self.out is not None
        self.out.mkdir(parents=True, exist_ok=True)
        figure.savefig(self.out / name)
        print(self.out / name)

    @property
    def draws(self) -> bool:
        """Whether pictures are wanted and can be made."""
        if self.out is None:
            return False
        reason = can_render()
        if reason is not None:
            print(f"no pictures: {reason}")
        return reason is None


def value(muscle: Any, name: str) -> float:
    """Return a number that the deformer reports, e.g. ``VolumeRatio``."""
    found = field_array(muscle, name)
    assert found is not None, name
    return float(found[-1])


def picture(bones: Any, muscles: Sequence[Any], view: View | None = None, **options: Any) -> NDArray[Any]:
    """Return the pixels of a picture, if no view is given from where the bones hide least of the muscles."""
    if view is None:
        view = choose_view(list(muscles), [bones] * len(muscles))
    plotter = make_plotter(bones, muscles, view, **options)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(pixels)


def seen_alike(rows: Sequence[Sequence[tuple[str, tuple[Any, Any] | None]]]) -> list[list[tuple[str, Any]]]:
    """Return titled pictures of bones and muscles, all from where the last shows most."""
    last = rows[-1][-1][1]
    assert last is not None
    bones, muscle = last
    # The others may be anywhere: some settings throw points to where no picture would hold the rest.
    view = choose_view([muscle], [bones])
    blank = np.full((8, 8, 3), 255, dtype=np.uint8)
    return [[(t, blank if p is None else picture(p[0], [p[1]], view)) for t, p in row] for row in rows]


#: What is said of a muscle that is nowhere.
LEFT = "left the range of numbers"


def rms(a: Any, b: Any) -> float:
    """Return the root mean square distance between the points of two surfaces [mm]."""
    return float(np.sqrt(np.mean(np.sum((points_of(a) - points_of(b)) ** 2, axis=1))))


def roughness(muscle: Any) -> float:
    """Return the 95th percentile of the angles between triangles [degrees]: how crumpled a surface is."""
    points, triangles = checked_surface(muscle, "muscle")
    quads = mesh_topology(len(points), triangles).quads
    edge = points[quads[:, 1]] - points[quads[:, 0]]
    first = np.cross(edge, points[quads[:, 2]] - points[quads[:, 0]])
    second = np.cross(points[quads[:, 3]] - points[quads[:, 0]], edge)
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    flat = lengths > 0.0
    cosines = np.einsum("ij,ij->i", first, second)[flat] / lengths[flat]
    return float(np.degrees(np.percentile(np.arccos(np.clip(cosines, -1.0, 1.0)), 95)))


def mean_edge(surface: Any) -> float:
    """Return the mean length of a surface's edges."""
    points, triangles = checked_surface(surface, "surface")
    return float(edge_lengths(points, mesh_topology(len(points), triangles).edges).mean())


def quietly(algorithm: Any, *inputs: Any) -> Any:
    """Return what a filter makes, without its warnings: what they tell is what an experiment counts."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pv.wrap(algorithm(*inputs)).copy()


def angles_up_to(degrees: float) -> list[float]:
    """Return the flexions of the frames, 0 to some angle."""
    return list(np.arange(0.0, degrees + STEP / 2.0, STEP))


def main(doc: str, tables: Callable[[Case], Iterator[Table] | list[Table]]) -> None:
    """Run an experiment as the command line asks for, and print its tables."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked = case_options(parser).parse_args()
    for table in tables(case_of(asked)):
        print(table.text(), end="\n\n", flush=True)


def case_options(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Add the options that all experiments have."""
    parser.add_argument("--data", choices=("real", "phantom"), help="default: real where it is")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="draw pictures there")
    parser.add_argument("--short", action="store_true", help="leave out what takes long")
    return parser


def case_of(asked: argparse.Namespace) -> Case:
    """Return what the options ask for."""
    there = (data_folder() / "scene.toml").is_file()
    if asked.data == "real" and not there:
        raise SystemExit(
            f"{data_folder()} is not there; set VTKMUSCLE_DATA to the folder that holds lhdl_hip"
        )
    return Case(real=there and asked.data != "phantom", short=asked.short, out=asked.out)
