"""Where muscles are fixed to bones: Kohout and Cervenka 2021, section 3.3.

Open :mod:`~vtkmuscle.core.attachments.patches` for the patch that a ring of landmarks bounds, and
:mod:`~vtkmuscle.core.attachments.contacts` for the estimate of areas without digitised landmarks (ours).
"""
