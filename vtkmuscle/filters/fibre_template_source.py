"""FibreTemplateSource: fibres in the unit cube."""

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import errors_at
from vtkmuscle.core.fibres.between_areas import AT_ONCE
from vtkmuscle.core.mesh.sampling import space_order
from vtkmuscle.core.template import KINDS, TEMPLATES, read_template, sobol_points
from vtkmuscle.data.arrays import Polylines, add_arrays, polylines_from
from vtkmuscle.filters.base import Filter, OutputPort, Parameter


class FibreTemplateSource(Filter):
    """Make fibres of a chosen architecture in the unit cube.

    Each fibre is a Bezier curve from the origin area, at the bottom of the cube, to the insertion area, at
    the top; two parameters (r, s) select the curve. The parameters are Sobol points, as in the paper; above
    256 fibres, neighbours in the order are neighbours in space. Points of a fibre are equally spaced in the
    parameter t. :mod:`vtkmuscle.core.template` describes the kinds and the files.

    Parameters
    ----------
    template
        Architecture of the fibres.
    template_file
        A .toml or .json file with a custom template, in place of ``template``.
    n_fibres
        Number of fibres.
    resolution
        Segments of each fibre, one less than points.

    Attributes
    ----------
    output
        Polylines from origin to insertion, with the point array ``t`` (0 at the origin, 1 at the insertion),
        the cell arrays ``r``, ``s`` and ``FibreId``, and the field arrays ``OriginArea`` and
        ``InsertionArea``: corners (3 components) of the template's areas, four per area, and ``Template``:
        the kind, or ``file``.

    Raises
    ------
    ValueError
        If the file cannot be read or has no template; the message gives the position and the allowed values.

    References
    ----------
    Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.1,
    extended in doi:10.1007/978-3-642-38241-3_3; Blemker, Delp 2005, *Three-dimensional representation of
    complex muscle architectures and geometries*, doi:10.1007/s10439-005-1433-7.

    Limitations
    -----------
    Templates are idealised: the architecture is a choice, not a measurement. Fibres are equally spaced in t,
    not in arc length.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTemplateSource
    >>> fibres = FibreTemplateSource(template="pennate", n_fibres=10, resolution=19).update().output
    >>> fibres.GetNumberOfCells(), fibres.GetNumberOfPoints()
    (10, 200)
    """

    template = Parameter(str, default="parallel", choices=KINDS)
    template_file: Parameter[str | None] = Parameter(str, default=None)
    n_fibres = Parameter(int, default=100, minimum=1, maximum=100_000)
    resolution = Parameter(int, default=15, minimum=1, maximum=10_000)

    output = OutputPort(vtkPolyData)

    def execute(self) -> vtkPolyData:
        """Return the template."""
        template = TEMPLATES[self.template]
        if self.template_file is not None:
            with errors_at(f"{type(self).__name__}: template_file"):
                template = read_template(self.template_file)
        parameters = sobol_points(self.n_fibres)
        # Every second or eighth Sobol point is in one part of the square, but areas are divided among batches
        # of every n-th fibre, which must cover the square.
        if self.n_fibres > AT_ONCE:
            parameters = parameters[space_order(parameters)]
        r, s = parameters.T
        t = np.linspace(0.0, 1.0, self.resolution + 1)
        points = template.fibres(r, s, t).reshape(-1, 3)
        ends = {"OriginArea": 0, "InsertionArea": -1}
        areas = {name: template.areas(sheet).reshape(-1, 3) for name, sheet in ends.items()}
        fields = {"Template": self.template if self.template_file is None else "file"} | areas
        lines = polylines_from(Polylines(points, np.arange(0, len(points) + 1, len(t))))
        cells = {"r": r, "s": s, "FibreId": np.arange(self.n_fibres)}
        return add_arrays(lines, points={"t": np.tile(t, self.n_fibres)}, cells=cells, fields=fields)
