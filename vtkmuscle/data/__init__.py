"""VTK data and what it carries: arrays, attachment areas, bones in motion, provenance.

Everything here knows VTK's data sets, and no filter.
"""
