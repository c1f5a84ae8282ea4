"""Runs over one another: settings, sides, subjects, published curves and OpenSim's own muscles."""

from __future__ import annotations

from vtkmuscle.comparison.comparison import Comparison, compare

__all__ = ["Comparison", "compare"]
