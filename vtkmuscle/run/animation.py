"""A run as an animation of Universal Scene Description (USD)."""

import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import MILLIMETRES
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data import arrays
from vtkmuscle.data.arrays import Polylines, point_array, points_of, polylines_of, triangles_of
from vtkmuscle.filters.fibre_tubes import FibreTubes
from vtkmuscle.io.writing import replacing
from vtkmuscle.plotting.studio import COLOURS, strain_colours, strains_of
from vtkmuscle.plotting.views import IVORY, MUSCLE_RED
from vtkmuscle.run.result_data import ResultData
from vtkmuscle.run.table import optional_package

#: Suffixes of USD, binary or as text.
SUFFIXES = (".usd", ".usdc", ".usda")


def write_usd(result: ResultData, path: Path, *, tubes: bool, width: float = 0.01) -> None:
    """Write bones, muscles and fibres of a run to a file of USD; see :meth:`vtkmuscle.Result.write_usd`.

    Bones have moving transforms, and muscles moving points. ``width`` is the diameter of a fibre, as a part
    of the fibres' mean length.
    """
    check_format(path)
    with TemporaryDirectory() as folder, replacing(path) as new:
        drawn = Path(folder) / f"animation{path.suffix.lower()}"  # USD goes by the suffix
        stage = _Stage(drawn, result.name, MILLIMETRES[result.units] / 1000.0, len(result.frames))
        for name, bone in arrays.blocks_of(result.rest_bones()):
            mesh = stage.mesh("bones", name, [(points_of(bone), triangles_of(bone, name))])
            stage.paint(mesh, IVORY)
            stage.move(mesh, [result.motion.at(time).get(name, np.eye(4)) for time in result.times])
        for name in result.muscle_names:
            track = result.track(name)
            if track.surfaces:
                triangles = triangles_of(track.rest, name)
                moving = ((points_of(surface), triangles) for surface in track.surfaces)
                stage.paint(stage.mesh("muscles", name, moving), MUSCLE_RED)
            if track.fibres and track.rest_fibres is not None:
                lines = [polylines_of(fibres, name) for fibres in track.fibres]
                rest = polylines_of(track.rest_fibres, name).lengths
                strains, limit = strains_of(rest, [each.lengths for each in lines])
                colours = [strain_colours(strain, limit) / 255.0 for strain in strains]
                draw = stage.tubes if tubes else stage.curves
                draw(name, lines, colours, width * float(rest.mean()))
        stage.save()
        shutil.copyfile(drawn, new)


def check_format(path: Path) -> None:
    """Raise an InputError for a file that is not of USD, or without usd-core."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(str(path), "an animation is a file of USD", f"end its name in {', '.join(SUFFIXES)}")
    optional_package("pxr.Usd", "USD", "usd-core", path)


class _Stage:
    """A new stage of USD in metres, with one root; many programs ignore its unit."""

    def __init__(self, path: Path, name: str, metres: float, n_frames: int) -> None:
        modules = ("Usd", "UsdGeom", "UsdShade", "Sdf", "Gf", "Tf")
        usd, self._geometry, self._shade, self._sdf, self._gf, self._tf = (
            optional_package(f"pxr.{module}", "USD", "usd-core") for module in modules
        )
        self._metres, self._tokens = metres, self._geometry.Tokens
        self._stage = usd.Stage.CreateNew(str(path))
        self._geometry.SetStageUpAxis(self._stage, self._tokens.z)
        self._geometry.SetStageMetersPerUnit(self._stage, 1.0)
        self._stage.SetStartTimeCode(0)
        self._stage.SetEndTimeCode(n_frames - 1)
        self._root = self._geometry.Xform.Define(self._stage, f"/{self._tf.MakeValidIdentifier(name)}")
        self._stage.SetDefaultPrim(self._root.GetPrim())

    def save(self) -> None:
        """Write the file."""
        self._stage.GetRootLayer().Save()

    def mesh(self, group: str, name: str, frames: Iterable[tuple[Floats, Ints]]) -> Any:
        """Return a new mesh, with points (n, 3) and triangles (m, 3) by frame."""
        mesh, before = self._new(self._geometry.Mesh, group, name), None
        mesh.CreateSubdivisionSchemeAttr(self._tokens.none)
        for frame, (points, triangles) in enumerate(frames):
            self._place(mesh, points, frame)
            if before is None or not np.array_equal(triangles, before):
                mesh.CreateFaceVertexCountsAttr().Set(np.full(len(triangles), 3, dtype=np.int32), frame)
                mesh.CreateFaceVertexIndicesAttr().Set(triangles.ravel().astype(np.int32), frame)
            before = triangles
        return mesh

    def move(self, mesh: Any, transforms: Sequence[Floats]) -> None:
        """Move a mesh by transforms (4, 4) by frame."""
        operation, units = mesh.AddTransformOp(), np.ones((4, 4))
        units[:3, 3] = self._metres
        for frame, transform in enumerate(transforms):
            operation.Set(self._gf.Matrix4d((units * transform).T), frame)

    def curves(self, name: str, frames: Sequence[Polylines], colours: Sequence[Floats], width: float) -> None:
        """Add fibres as curves, with colours (k, 3) by frame."""
        curves = self._new(self._geometry.BasisCurves, "fibres", name)
        curves.CreateTypeAttr(self._tokens.linear)
        curves.CreateCurveVertexCountsAttr(np.diff(frames[0].offsets).astype(np.int32))
        curves.CreateWidthsAttr([self._metres * width])
        curves.SetWidthsInterpolation(self._tokens.constant)
        for frame, lines in enumerate(frames):
            self._place(curves, lines.points, frame)
        self._paint_each(curves, self._tokens.uniform, colours)

    def tubes(self, name: str, frames: Sequence[Polylines], colours: Sequence[Floats], width: float) -> None:
        """Add fibres as a mesh of tubes, with colours (k, 3) by frame."""
        make, drawn = FibreTubes(radius=width / 2.0, sides=6), []
        for lines, colour in zip(frames, colours, strict=True):
            own = {COLOURS: np.repeat(colour, np.diff(lines.offsets), axis=0)}
            plain = arrays.polylines_from(Polylines(lines.points, lines.offsets))
            drawn.append(arrays.joined_triangles(make(arrays.add_arrays(plain, points=own)))[0])
        mesh = self.mesh("fibres", name, ((points_of(tube), triangles_of(tube, name)) for tube in drawn))
        self._paint_each(mesh, self._tokens.vertex, [point_array(tube, COLOURS, name) for tube in drawn])

    def paint(self, prim: Any, colour: str) -> None:
        """Give a prim one colour."""
        value = _linear(np.array([to_rgb(colour)]))
        prim.CreateDisplayColorAttr(value)
        self._diffuse(prim).Set(self._gf.Vec3f(*value[0].tolist()))

    def _paint_each(self, prim: Any, kind: str, colours: Sequence[Floats]) -> None:
        """Give the parts of a prim colours (k, 3) by frame."""
        for frame, colour in enumerate(colours):
            prim.CreateDisplayColorPrimvar(kind).Set(_linear(colour), frame)
        reader = self._shade.Shader.Define(self._stage, f"{prim.GetPath()}/material/colour")
        reader.CreateIdAttr("UsdPrimvarReader_float3")
        reader.CreateInput("varname", self._sdf.ValueTypeNames.String).Set("displayColor")
        self._diffuse(prim).ConnectToSource(reader.ConnectableAPI(), "result")

    def _diffuse(self, prim: Any) -> Any:
        """Return the colour of a prim's new material."""
        types, path = self._sdf.ValueTypeNames, f"{prim.GetPath()}/material"
        material = self._shade.Material.Define(self._stage, path)
        shader = self._shade.Shader.Define(self._stage, f"{path}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        self._shade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)
        return shader.CreateInput("diffuseColor", types.Color3f)

    def _new(self, kind: Any, group: str, name: str) -> Any:
        """Return a new prim in a group below the root, of a name that USD allows."""
        parent = self._geometry.Xform.Define(self._stage, f"{self._root.GetPath()}/{group}")
        path = f"{parent.GetPath()}/{self._tf.MakeValidIdentifier(name)}"
        while self._stage.GetPrimAtPath(path):
            path += "_"
        return kind.Define(self._stage, path)

    def _place(self, prim: Any, points: Floats, frame: int) -> None:
        points = (self._metres * points).astype(np.float32)
        prim.CreatePointsAttr().Set(points, frame)
        prim.CreateExtentAttr().Set(self._geometry.PointBased.ComputeExtent(points), frame)


def _linear(colours: Floats) -> NDArray[np.float32]:
    """Return sRGB colours as linear colours (IEC 61966-2-1)."""
    bright = ((colours + 0.055) / 1.055) ** 2.4
    return np.where(colours <= 0.04045, colours / 12.92, bright).astype(np.float32)
