"""What speed costs in accuracy: a scene run over many settings and compared with a converged run of it."""

from vtkmuscle.tradeoff.plots import write_plots
from vtkmuscle.tradeoff.study import Study, trade_off
from vtkmuscle.tradeoff.table import write_tables
from vtkmuscle.tradeoff.trial import thinned

__all__ = ["Study", "thinned", "trade_off", "write_plots", "write_tables"]
