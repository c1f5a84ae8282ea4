"""What speed costs in accuracy: a scene run over many settings and compared with a converged run of it."""

from vtkmuscle.studies.tradeoff.page import write_trade_off
from vtkmuscle.studies.tradeoff.study import TradeOff, trade_off

__all__ = ["TradeOff", "trade_off", "write_trade_off"]
