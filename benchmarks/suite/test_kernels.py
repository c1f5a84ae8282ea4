"""Kernels: settling, weights, distances, what is made of a mesh once."""

from __future__ import annotations

import numpy as np
from calibration import TRIANGLES, torus
from problems import held_torus, settling_of

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.fibres.embedding import sparse_mean_value_coordinates, sparse_transport
from vtkmuscle.core.mesh.harmonic import harmonic_weights
from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.data.arrays import blocks_of, checked_surface, points_of

ROUNDS, FEW = 20, 3


def test_settling(measured):
    measured(settling_of(TRIANGLES), rounds=ROUNDS)


def test_topology(measured):
    points, triangles = torus(TRIANGLES)
    measured(lambda: mesh_topology(len(points), triangles), rounds=ROUNDS)


def test_harmonic_weights(measured):
    points, mass, topology, _ = held_torus(TRIANGLES)
    fixed_to = np.where(mass == 0.0, np.arange(len(points)) % 2, -1)
    measured(lambda: harmonic_weights(points, topology.triangles, fixed_to), rounds=FEW)


def test_mean_value_weights_of_1600_points(measured, hip):
    points, triangles = checked_surface(hip.muscle, "iliacus")
    queries = points_of(hip.hundred_fibres)
    measured(lambda: sparse_mean_value_coordinates(points, triangles, queries, prune=0.0), rounds=FEW)


def test_transport_of_1600_points(measured, hip):
    points, triangles = checked_surface(hip.muscle, "iliacus")
    weights = sparse_mean_value_coordinates(points, triangles, points_of(hip.hundred_fibres), prune=0.0)
    measured(lambda: sparse_transport(weights, points), rounds=ROUNDS)


def test_field_of_a_bone_all_over_its_surface(measured, hip):
    points, triangles = checked_surface(dict(blocks_of(hip.phantom.bones))["femur"], "femur")
    measured(lambda: Bone(points, triangles).field(points), rounds=FEW)
