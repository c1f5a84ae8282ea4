"""What the tests of several filters have in common."""

import pytest
from vtkmodules.vtkFiltersSources import vtkSphereSource


@pytest.fixture
def muscle():
    source = vtkSphereSource(radius=20.0, theta_resolution=16, phi_resolution=12, output_points_precision=1)
    return source.update().output
