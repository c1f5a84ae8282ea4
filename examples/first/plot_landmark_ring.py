"""
Landmarks on their bones
========================

:meth:`Scene.plot` shows landmarks before a run: origins are black, insertions red. A ring bounds an area of
the bone; numbers give the order of the landmarks.
"""

from vtkmuscle import Scene, phantoms

scene = Scene.from_phantom(phantoms.hip())
plotter = scene.plot(show=False)
plotter.show()

# %%
# Close up: the origin of the iliacus in the hollow of the pelvis, with landmarks in order round the area.

origin = scene.muscles["iliacus"].attachments[0]
plotter = scene.plot(muscles="iliacus", show=False)
for number, point in enumerate(origin.landmarks[::2]):
    plotter.add_point_labels(point[None], [str(2 * number)], always_visible=True, shape=None, font_size=20)
plotter.camera_position = [(500, -400, 60), origin.landmarks.mean(axis=0), (0, 0, 1)]
plotter.camera.zoom(1.3)
plotter.show()
