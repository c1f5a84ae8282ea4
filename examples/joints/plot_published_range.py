"""
Published moment arms without being asked for
=============================================

A muscle with a published name, moved by a coordinate with a known direction, is drawn beside the range of
moment arms in published models. The verdict checks the same range (:doc:`/reference/verdicts`).
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from vtkmuscle import Scene, hinge, phantoms, plotting

scene = Scene.from_phantom(phantoms.hip(), n_fibres=40).with_muscles("iliacus")
flexion = hinge("femur", (0, 0, 0), (-1, 0, 0), range(0, 91, 10), coordinate="hip_flexion")
result = replace(scene, motion=flexion, deformer="none").run()
arms = result.moment_arms()["iliacus"]
figure = plotting.plot_moment_arms(arms, literature=result.published_arms("iliacus"))
figure.canvas.draw()
shown = plt.figure(figsize=figure.get_size_inches(), dpi=figure.dpi)
shown.figimage(np.asarray(figure.canvas.buffer_rgba()))
plt.show()
