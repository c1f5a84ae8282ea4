"""Fibres pulled taut round the bones: the shortest paths that muscles under tension take.

Neither of the two papers has this: Kohout and Cervenka 2021 keep the lengths of a muscle's edges, which says
nothing of what its fibres do when their ends come nearer. Start reading at :mod:`~vtkmuscle.core.taut.paths`;
:mod:`~vtkmuscle.core.paths.tissue` says what lies between fibres and bones at rest,
:mod:`~vtkmuscle.core.taut.bedding` what holds a muscle's bow where no bone does,
:mod:`~vtkmuscle.core.taut.strings` has the kernel that pulls, :mod:`~vtkmuscle.core.taut.bone_fields` the
distances from the bones, and :mod:`~vtkmuscle.core.taut.carrying` takes a muscle's surface along.
"""
