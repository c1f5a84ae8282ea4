"""Public data sets as scenes: downloaded from where they are published, checked, and put together.

A data set is a module here that says its licence, its files and how these become a scene, and an entry of
:data:`DATA_SETS`.
"""

from vtkmuscle.fetch.datasets import DataSet, RemoteFile, SurfaceFigures
from vtkmuscle.fetch.download import DATA_SETS, HOST, data_set, fetch

__all__ = ["DATA_SETS", "HOST", "DataSet", "RemoteFile", "SurfaceFigures", "data_set", "fetch"]
