"""Attachments of muscles to bones. Kohout and Cervenka 2021, section 3.3.

Open :mod:`~vtkmuscle.core.attachments.patches` for the patch bounded by a ring of landmarks, and
:mod:`~vtkmuscle.core.attachments.contacts` for the estimate of areas without digitised landmarks (ours).
"""
