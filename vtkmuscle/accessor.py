"""The PyVista accessor ``mesh.muscle``, found by PyVista through the entry point ``pyvista.accessors``."""

from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import Remedies
from vtkmuscle.data.arrays import Polylines, joined_triangles, polylines_from
from vtkmuscle.data.attachments import AttachmentArea, landmarks_of
from vtkmuscle.filters import FibreMetrics, FibreTubes, FixedPointDetector
from vtkmuscle.pipelines import decompose, deform
from vtkmuscle.plotting.plotters import MovingScene


@pyvista.register_dataset_accessor("muscle", pyvista.PolyData)
class MuscleAccessor(Remedies):
    """Filters as methods of a muscle's mesh or fibres.

    Methods return new PyVista meshes, do not change the mesh, and raise the errors of the filters. Chains
    that follow changes upstream, e.g. of a time slider, are in :mod:`vtkmuscle.pipelines`.

    Parameters
    ----------
    mesh : pyvista.PolyData
        A muscle, or fibres; PyVista gives it.

    Examples
    --------
    >>> import pyvista as pv
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> mesh = pv.wrap(phantom.muscles["spindle"])
    >>> attachments = phantom.attachments["spindle"]
    >>> fibres = mesh.muscle.fibres(attachments, n_fibres=10)
    >>> fibres.muscle.fibre_lengths().shape
    (10,)
    >>> fixed = mesh.muscle.fixed(phantom.bones, attachments)
    >>> bent = fixed.muscle.deformed(phantom.bones, phantom.motion, time=10.0, iterations=3)
    >>> bool(abs(bent.volume / mesh.volume - 1.0) < 0.01)
    True
    """

    def __init__(self, mesh: Any) -> None:
        self._given = mesh

    @property
    def _mesh(self) -> Any:
        """The mesh; polygons as triangles, equal points joined as by ``vtkmuscle.io.read_surface``."""
        joined, changes = joined_triangles(self._given)
        return pyvista.wrap(joined) if changes else self._given

    def fixed(self, bones: Any, attachments: Any, **parameters: Any) -> Any:
        """Return the muscle with the point array ``FixedTo``.

        Parameters
        ----------
        bones : pyvista.MultiBlock or mapping of str to vtkPolyData
            Bones at rest, by name.
        attachments : vtkMultiBlockDataSet or sequence of AttachmentArea
            The attachment areas.
        **parameters
            Of :class:`~vtkmuscle.filters.FixedPointDetector`: ``method``, ``distance``.
        """
        detector = FixedPointDetector(muscle=self._mesh, bones=bones, attachments=attachments, **parameters)
        return detector.apply()

    def deformed(
        self, bones: Any, motion: RigidMotion, *, time: float | None = None, fibres: Any = None,
        attachments: Any = None, **solver: Any,
    ) -> Any:  # fmt: skip
        """Return the muscle deformed with the bones.

        Parameters
        ----------
        bones, attachments
            As of :meth:`fixed`; a mesh with the point array ``FixedTo`` needs no attachments.
        motion : RigidMotion
            Motion of the bones.
        time : float, optional
            Time; by default the last time step of the motion.
        fibres : vtkPolyData, optional
            Fibres at rest, for the paths.
        **solver
            Of :func:`vtkmuscle.pipelines.deform`: ``deformer``, and the parameters of the deformer.
        """
        fixing: Any = None if attachments is None and "FixedTo" in self._mesh.point_data else {}
        last = deform(self._mesh, bones, motion, attachments, fibres=fibres, fixing=fixing, **solver)
        return last.apply(time=time)

    def fibres(
        self, attachments: Any = None, *, origin: Any = None, insertion: Any = None, **settings: Any
    ) -> Any:
        """Return fibres filling the muscle, polylines from origin to insertion.

        Parameters
        ----------
        attachments : vtkMultiBlockDataSet or sequence of AttachmentArea, optional
            All areas, instead of ``origin`` and ``insertion``.
        origin, insertion : (k, 3) array_like or vtkPolyData, optional
            Landmarks of each area [mm], as points or a polyline; a ring repeats its first point.
        **settings
            Of :func:`vtkmuscle.pipelines.decompose`: ``template``, ``n_fibres``, ``resolution`` and so on.
        """
        rings = {"origin": origin, "insertion": insertion}
        areas = [_area(role, points) for role, points in rings.items() if points is not None]
        if (attachments is None) == (not areas):
            raise ValueError("mesh.muscle.fibres: give either origin= and insertion=, or attachments=")
        return decompose(self._mesh, areas or attachments, **settings).apply()

    def fibre_lengths(self) -> Floats:
        """Return the length of each polyline (n,) [mm]. By FibreMetrics."""
        return np.array(FibreMetrics().apply(self._mesh)["Length"])

    def plot(
        self, *, fibres: Any = None, bones: Any = None, show: bool = True, off_screen: bool | None = None
    ) -> Any:
        """Show the muscle in a window or notebook. With fibres and bones.

        With ``show=False`` the plotter is returned before it is shown; ``off_screen`` is PyVista's own
        setting by default.
        """
        named = {} if bones is None else bones
        lines_alone = self._mesh.GetNumberOfPolys() == 0
        muscles = {} if lines_alone else {"muscle": self._mesh}
        lines = self._mesh if lines_alone else fibres
        scene = MovingScene(named, muscles, {} if lines is None else {"muscle": lines}, off_screen=off_screen)
        return scene.plotter.show() if show else scene.plotter

    def tubes(self, **parameters: Any) -> Any:
        """Return tubes around polylines. By :class:`~vtkmuscle.filters.FibreTubes`."""
        return FibreTubes(**parameters).apply(self._mesh)


def _area(role: str, landmarks: Any) -> AttachmentArea:
    """Return an area of landmarks; fibres do not need its bone."""
    if not isinstance(landmarks, vtkPolyData):
        points = np.asarray(landmarks, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or not len(points):
            raise ValueError(f"mesh.muscle: landmarks must be an array (k, 3), got the shape {points.shape}")
        landmarks = polylines_from(Polylines(points, np.array([0, len(points)])))
    return AttachmentArea(role, role, *landmarks_of(landmarks, f"mesh.muscle: {role}"))
