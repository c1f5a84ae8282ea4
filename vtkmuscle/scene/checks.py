"""What must hold of a scene before it is run."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.taut.via_rings import passes_through, via_ring
from vtkmuscle.core.words import shown, suggestion
from vtkmuscle.data.arrays import checked_surface, points_of, surface_from
from vtkmuscle.data.attachments import ROLES, VIA, AttachmentArea
from vtkmuscle.data.superficial import checked_superficial
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.deformer.quality import PRESETS
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.pipelines import FIBRE_SETTINGS, TRANSPORT_SETTINGS
from vtkmuscle.scene.model import MILLIMETRES, Muscle, SceneError
from vtkmuscle.scene.names import check_name

if TYPE_CHECKING:
    from vtkmuscle.scene.model import Scene

#: Names that the run writes itself, beside those of the muscles.
_RESERVED = ("bones", "figures", "scene")
#: What is done where muscles meet.
MUSCLE_CONTACTS = ("off", "on", "measure")

#: What a run computes of muscles.
MODELS = ("volume", "paths")
#: What a scene file has in place of a muscle's attachments, to have them estimated.
ESTIMATE = "estimate"
#: Landmarks farther from their muscle than this many of its diagonals are another muscle's, or in
#: another unit.
_FARTHEST_LANDMARKS = 1.0
#: Coordinates beyond this are no length of anything, and their squares may be no numbers.
_LARGEST = 1e60


def _check_model(scene: Scene) -> None:
    """Check what is to be computed of the muscles."""
    file = scene.files.get("")
    if scene.model not in MODELS:
        mend = suggestion(str(scene.model), MODELS)
        raise SceneError(f"{scene.model!r} is not allowed", key="model", mend=mend, file=file)
    if scene.model == "paths" and scene.muscle_contact != "off":
        raise SceneError(
            f"model is 'paths', in which no muscle has a surface, but this is {scene.muscle_contact!r}",
            key="muscle_contact",
            mend="leave it out, or use model 'volume'",
            file=file,
        )
    bare = [name for name, muscle in scene.muscles.items() if muscle.fibres is None]
    if scene.model == "paths" and bare:
        raise SceneError(
            "model is 'paths', which moves fibres, but this muscle has none",
            key=f"muscles.{bare[0]}.fibres",
            mend="add a table fibres, or use model 'volume'",
            file=file,
        )


def checked_names(scene: Scene) -> None:
    """Check the names of the scene, its bones and muscles, and the unit."""
    file = scene.files.get("")
    if scene.units not in MILLIMETRES:
        problem = f"there is no unit {scene.units!r}"
        raise SceneError(problem, key="units", mend=suggestion(str(scene.units), MILLIMETRES), file=file)
    if scene.muscle_contact not in MUSCLE_CONTACTS:
        problem = f"{scene.muscle_contact!r} is not allowed"
        mend = suggestion(str(scene.muscle_contact), MUSCLE_CONTACTS)
        raise SceneError(problem, key="muscle_contact", mend=mend, file=file)
    _check_model(scene)
    if scene.quality is not None and scene.quality not in PRESETS:
        problem = f"there is no preset {scene.quality!r}"
        raise SceneError(problem, key="quality", mend=suggestion(str(scene.quality), PRESETS), file=file)
    for key, name in [
        ("name", scene.name),
        *((f"bones.{bone}", bone) for bone in scene.bones),
        *((f"muscles.{muscle}", muscle) for muscle in scene.muscles),
    ]:
        check_name(name, key, file)
    for kind, names in (("bones", scene.bones), ("muscles", scene.muscles)):
        if not names:
            problem = f"the scene has no {kind}"
            raise SceneError(problem, key=kind, mend=f"add a table [{kind}.NAME] with its surface", file=file)
        _check_distinct(kind, list(names), file)
    for name in scene.muscles:
        plain = name.casefold().removesuffix("_fibres")
        others = {other.casefold() for other in scene.muscles}
        if name.casefold() in _RESERVED or (plain != name.casefold() and plain in others):
            raise SceneError(
                f"the results of a muscle called {name!r} would overwrite other results",
                key=f"muscles.{name}",
                mend="call it otherwise",
                file=file,
            )
    _check_settings(scene, scene.solver, PBDDeformer.parameter_declarations, "solver")
    _check_settings(scene, scene.fixing, FixedPointDetector.parameter_declarations, "fixing")
    for bone in scene.motion.transforms:
        if bone not in scene.bones:
            raise SceneError(
                f"there is no bone {bone!r}",
                key="motion.bone",
                mend=suggestion(bone, scene.bones),
                file=file,
            )


def checked_bones(scene: Scene) -> dict[str, vtkPolyData]:
    """Return the bones, each checked.

    What is open or inside out is mended where its inside is asked for, which warns of it.
    """
    return {
        name: _checked_surface(scene, f"bones.{name}.surface", surface, closed=False)
        for name, surface in scene.bones.items()
    }


def _setting(kind: type[Filter], name: str, *settings: Mapping[str, Any]) -> Any:
    """Return the value of a parameter: the last that is given, or its default."""
    given = [table[name] for table in settings if name in table]
    return given[-1] if given else kind.parameter_declarations[name].default


def checked_muscles(scene: Scene) -> dict[str, Muscle]:
    """Return the muscles, each checked, its surface facing outward."""
    muscles = {}
    for name, muscle in scene.muscles.items():
        key = f"muscles.{name}"
        surface = _checked_surface(scene, f"{key}.surface", muscle.surface, closed=True)
        _check_one_piece(scene, f"{key}.surface", surface)
        _check_settings(scene, muscle.solver, PBDDeformer.parameter_declarations, f"{key}.solver")
        _check_settings(scene, muscle.fixing, FixedPointDetector.parameter_declarations, f"{key}.fixing")
        if muscle.fibres is not None:
            declarations = {
                word: kind.parameter_declarations[p]
                for word, (kind, p) in (FIBRE_SETTINGS | TRANSPORT_SETTINGS).items()
            }
            _check_settings(scene, muscle.fibres, declarations, f"{key}.fibres")
        _check_attachments(scene, f"{key}.attachments", muscle, surface)
        _check_superficial(scene, f"{key}.superficial_fibres", muscle, points_of(surface))
        muscles[name] = replace(muscle, surface=surface, attachments=tuple(muscle.attachments))
    return muscles


def _check_distinct(kind: str, names: list[str], file: Any) -> None:
    seen: dict[str, str] = {}
    for name in names:
        other = seen.setdefault(name.casefold(), name)
        if other != name:
            raise SceneError(
                f"{name!r} and {other!r} are the same file name on some systems",
                key=f"{kind}.{name}",
                mend="call one of them otherwise",
                file=file,
            )


def _check_settings(
    scene: Scene, settings: Mapping[str, Any], declarations: Mapping[str, Parameter[Any]], key: str
) -> None:
    file = scene.files.get("")
    for name, value in settings.items():
        if name not in declarations:
            mend = suggestion(name, declarations)
            raise SceneError(f"there is no setting {name!r}", key=f"{key}.{name}", mend=mend, file=file)
        try:
            declarations[name].check(value, key)
        except ValueError:
            raise SceneError(
                f"{shown(value)} is not allowed",
                key=f"{key}.{name}",
                mend=f"it must be {declarations[name].allowed}",
                file=file,
            ) from None


def _checked_surface(scene: Scene, key: str, surface: vtkPolyData, *, closed: bool) -> vtkPolyData:
    file = scene.files.get(key)
    try:
        points, triangles = checked_surface(surface, "the surface")
    except ValueError as error:
        problem, _, mend = str(error).removeprefix("the surface: ").partition("; ")
        mend = mend or "correct them, or export the surface again"
        raise SceneError(problem, key=key, mend=mend, file=file) from error
    if np.abs(points).max() > _LARGEST:
        point = int(np.abs(points).max(axis=1).argmax())
        problem = f"point {point} has a coordinate of {np.abs(points[point]).max():.4g}"
        raise SceneError(problem, key=key, mend="correct that point, or remove it", file=file)
    report = survey(points, triangles)
    faults = [
        (
            closed and not report.closed,
            f"the surface is open: {report.n_boundary_edges} edges belong to one triangle only",
            "fill its holes (pyvista: mesh.fill_holes(size)); if there are none to see, merge coincident "
            "points (pyvista: mesh.clean())",
        ),
        (
            closed and not report.manifold,
            f"the surface is not manifold: {report.n_nonmanifold_edges} edges have more than two triangles",
            "delete the extra triangles, e.g. with MeshLab's 'repair non manifold edges'",
        ),
        (
            closed and not report.oriented,
            f"neighbouring triangles disagree on their side at {report.n_misoriented_edges} edges",
            "orient them alike (pyvista: mesh.compute_normals(consistent_normals=True))",
        ),
        (
            closed and report.closed and report.volume == 0,
            "the surface has no volume",
            "export it again",
        ),
    ]
    for at_fault, problem, mend in faults:
        if at_fault:
            raise SceneError(problem, key=key, mend=mend, file=file)
    if closed and report.volume < 0:
        warnings.warn(
            f"{file or 'scene'}: {key}: the surface is inside out; its triangles were turned to face outward",
            stacklevel=2,
        )
        return _turned(surface, points, triangles)
    return surface


def _turned(surface: vtkPolyData, points: NDArray[Any], triangles: NDArray[Any]) -> vtkPolyData:
    turned = surface_from(points, triangles[:, ::-1])
    turned.GetPointData().ShallowCopy(surface.GetPointData())
    turned.GetCellData().ShallowCopy(surface.GetCellData())
    turned.GetFieldData().ShallowCopy(surface.GetFieldData())
    return turned


def _check_one_piece(scene: Scene, key: str, surface: vtkPolyData) -> None:
    report = survey(*checked_surface(surface, key))
    file = scene.files.get(key)
    if report.n_components > 1:
        raise SceneError(
            f"the surface falls into {report.n_components} separate pieces",
            key=key,
            mend="keep the largest (pyvista: mesh.extract_largest()), or make each piece its own muscle",
            file=file,
        )
    if report.n_unused_points:
        raise SceneError(
            f"{report.n_unused_points} points belong to no triangle",
            key=key,
            mend="remove them (pyvista: mesh.clean())",
            file=file,
        )


def _check_attachments(scene: Scene, key: str, muscle: Muscle, surface: vtkPolyData) -> None:
    file = scene.files.get("")
    by_attachment = _setting(FixedPointDetector, "method", scene.fixing, muscle.fixing) == "attachment"
    roles = {area.role for area in muscle.attachments} - {VIA}
    wanted = ROLES if muscle.fibres is not None else (() if roles or not by_attachment else ROLES[:1])
    for number, area in enumerate(muscle.attachments):
        _check_attachment(scene, f"{key}[{number}]", area, surface)
    for role in wanted:
        if role not in roles:
            raise SceneError(
                f"there is no attachment with role {role!r}",
                key=key,
                mend=f'add {{ role = "{role}", bone = "...", landmarks = "..." }}'
                + (
                    ""
                    if roles
                    else f', or write attachments = "{ESTIMATE}" (from where it touches the bones)'
                )
                + (", or leave out fibres" if muscle.fibres is not None else ""),
                file=file,
            )


def _check_attachment(scene: Scene, key: str, area: AttachmentArea, surface: vtkPolyData) -> None:
    file = scene.files.get("")
    if area.role not in (*ROLES, VIA):
        problem = f"there is no role {area.role!r}"
        raise SceneError(problem, key=f"{key}.role", mend=suggestion(area.role, (*ROLES, VIA)), file=file)
    if area.bone not in scene.bones:
        problem = f"there is no bone {area.bone!r}"
        raise SceneError(problem, key=f"{key}.bone", mend=suggestion(area.bone, scene.bones), file=file)
    file = scene.files.get(f"{key}.landmarks", file)
    landmarks = np.asarray(area.landmarks, dtype=np.float64)
    if landmarks.ndim != 2 or landmarks.shape[1] != 3 or not np.isfinite(landmarks).all():
        problem = "the landmarks are not finite points x, y, z"
        raise SceneError(problem, key=f"{key}.landmarks", mend="correct them", file=file)
    fewest = 3 if area.closed else 1
    if len(landmarks) < fewest:
        problem = f"there are {len(landmarks)} landmarks, but a ring needs {fewest}"
        raise SceneError(problem, key=f"{key}.landmarks", mend="add landmarks", file=file)
    _check_near(scene, f"{key}.landmarks", "the landmarks are", landmarks, points_of(surface))
    if area.role == VIA:
        _check_ring(scene, key, area, surface)


def _check_ring(scene: Scene, key: str, area: AttachmentArea, surface: vtkPolyData) -> None:
    """Check that a via ring is a ring, and that the muscle passes through it."""
    if not area.closed:
        raise SceneError(
            "a via ring is closed",
            key=f"{key}.closed",
            mend="leave closed out, or write closed = true",
            file=scene.files.get(""),
        )
    file = scene.files.get(f"{key}.landmarks", scene.files.get(""))
    try:
        ring = via_ring(area.landmarks)
    except ValueError as error:
        problem, _, mend = str(error).partition("; ")
        mend = mend or "give landmarks round the muscle, in order"
        raise SceneError(problem, key=f"{key}.landmarks", mend=mend, file=file) from error
    points, triangles = checked_surface(surface, key)
    if not passes_through(ring, points, triangles):
        gap = np.linalg.norm(points - ring.centre, axis=1).min()
        raise SceneError(
            f"the muscle does not pass through the via ring, whose centre is {gap:.4g} {scene.units} from "
            "the muscle's nearest point",
            key=f"{key}.landmarks",
            mend="digitise the ring round the muscle at rest, in the same unit and frame",
            file=file,
        )


def _check_superficial(scene: Scene, key: str, muscle: Muscle, points: NDArray[Any]) -> None:
    if muscle.superficial_fibres is None:
        return
    try:
        lines = checked_superficial(muscle.superficial_fibres, "superficial fibres")
    except ValueError as error:
        problem, _, mend = str(error).removeprefix("superficial fibres: ").partition("; ")
        mend = mend or "give polylines, one for each fibre, two points or more"
        raise SceneError(problem, key=key, mend=mend, file=scene.files.get(key)) from error
    _check_near(scene, key, "the fibres are", lines.points, points)


def _check_near(scene: Scene, key: str, what: str, places: NDArray[Any], points: NDArray[Any]) -> None:
    """Check that some places are about where the muscle with these points is."""
    lowest, highest = points.min(axis=0), points.max(axis=0)
    gaps = np.linalg.norm(np.maximum(np.maximum(lowest - places, places - highest), 0), axis=1)
    diagonal = np.linalg.norm(highest - lowest)
    if gaps.min() > _FARTHEST_LANDMARKS * diagonal:
        raise SceneError(
            f"{what} {gaps.min():.4g} {scene.units} away from the muscle, which is {diagonal:.4g} "
            f"{scene.units} long",
            key=key,
            mend="check that they belong to this muscle and are in the same unit and frame",
            file=scene.files.get(key, scene.files.get("")),
        )
