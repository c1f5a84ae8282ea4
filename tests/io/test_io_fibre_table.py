import csv

import numpy as np
import pytest
from numpy.testing import assert_allclose
from shapes import lines_of

from vtkmuscle.data.arrays import add_arrays, cell_array
from vtkmuscle.filters.fibre_metrics import FibreMetrics
from vtkmuscle.io import write_fibre_table


@pytest.fixture
def measured():
    fibres = lines_of(np.array([[[0, 0, 0], [3, 0, 0], [3, 4, 0]], [[0, 0, 0], [0, 6, 0], [0, 11, 0.0]]]))
    add_arrays(fibres, cells={"FibreId": np.array([4, 5])})
    return FibreMetrics()(fibres)


def test_the_table_has_a_row_per_fibre_and_a_column_per_measure(measured, tmp_path):
    path = write_fibre_table(measured, tmp_path / "fibres.csv")
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert set(rows[0]) == {"FibreId", "Length", "Tortuosity"}
    assert [row["FibreId"] for row in rows] == ["4", "5"]
    for name in rows[0]:
        assert_allclose([float(row[name]) for row in rows], cell_array(measured, name, ""), rtol=1e-9)


def test_fibres_without_measures_are_refused(tmp_path):
    bare = lines_of(np.zeros((1, 2, 3)))
    with pytest.raises(ValueError, match="run FibreMetrics"):
        write_fibre_table(bare, tmp_path / "fibres.csv")
