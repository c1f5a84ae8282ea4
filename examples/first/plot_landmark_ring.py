"""
Landmarks on their bones
========================

Before anything is run, :meth:`Scene.plot` shows whether landmarks lie where they should: origins are black,
insertions red. A ring bounds an area of the bone; the numbers say in which order its points were clicked.
"""

from vtkmuscle import Scene, phantoms

scene = Scene.from_phantom(phantoms.hip())
plotter = scene.plot(show=False)
plotter.show()

# %%
# From near by: the origin of the iliacus in the hollow of the pelvis, its points in order round the area.

origin = scene.muscles["iliacus"].attachments[0]
plotter = scene.plot(muscles="iliacus", show=False)
for number, point in enumerate(origin.landmarks[::2]):
    plotter.add_point_labels(point[None], [str(2 * number)], always_visible=True, shape=None, font_size=20)
plotter.camera_position = [(500, -400, 60), origin.landmarks.mean(axis=0), (0, 0, 1)]
plotter.camera.zoom(1.3)
plotter.show()
