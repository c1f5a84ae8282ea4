"""Joints: trees of bodies, functions of coordinates, fits to bones, and joints in files of OpenSim."""
