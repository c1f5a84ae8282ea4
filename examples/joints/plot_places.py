"""
Moment arms across a broad muscle
=================================

The paths of a broad muscle differ in moment arm: anterior paths flex, posterior paths may extend. A figure of
a run colours the paths by position across the muscle, with a picture of the muscle in the same colours; the
mean with error is black.
"""

import matplotlib.pyplot as plt
import numpy as np

from vtkmuscle import Scene, phantoms, plotting

scene = Scene.from_phantom(phantoms.hip(angles=range(0, 91, 10)), n_fibres=60).with_muscles("gluteus_medius")
result = scene.run()
one = result["gluteus_medius"]
with plotting.Studio() as studio:
    figure = plotting.plot_moment_arms(
        one.moment_arms,
        result.drawn_bones,
        studio,
        rest=plotting.MuscleFrame(
            result.rest_muscle("gluteus_medius"), {}, result.rest_fibres("gluteus_medius")
        ),
    )
figure.canvas.draw()
shown = plt.figure(figsize=figure.get_size_inches(), dpi=figure.dpi)
shown.figimage(np.asarray(figure.canvas.buffer_rgba()))
plt.show()
