"""What speed costs in accuracy: a scene run over many settings and compared with a converged run of it."""

from vtkmuscle.tradeoff.plots import write_plots
from vtkmuscle.tradeoff.study import Study, trade_off
from vtkmuscle.tradeoff.table import write_tables

__all__ = ["Study", "trade_off", "write_plots", "write_tables"]
