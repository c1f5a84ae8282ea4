"""The parts of PBDDeformer: the solver that it keeps, its report, its presets."""
