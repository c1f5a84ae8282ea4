"""Scenes from what there is: label maps, or meshes and landmarks, by guesses that say how sure they are.

:func:`~vtkmuscle.labels.maps.draft_of_labels` takes a segmentation,
:func:`~vtkmuscle.labels.meshes.draft_of_files` meshes and landmarks; the
:class:`~vtkmuscle.labels.draft.Draft` that comes of either is written as a scene.toml.
"""
