"""Colours of bones, muscles and fibres."""

from __future__ import annotations

IVORY = "#efe6d0"
MUSCLE_RED = "#8b1a1a"
#: A muscle around coloured fibres.
NEUTRAL = "#9a9590"
FIBRE_MAP = "coolwarm"
#: Positions across a muscle.
PLACE_MAP = "viridis"
#: Colours of Okabe and Ito, distinguishable for colour-blind readers; bones and muscles use the colours in
#: turn.
PALETTE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442")
