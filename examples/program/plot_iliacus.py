"""
Fixed points, bones that push, and the iliacus
==============================================

Figure 10 of Kohout and Cervenka 2021, on the phantom hip flexed by 40 degrees. With the paper's settings, the
iliacus has points fixed by collision, or by attachment, without and with bones that carry the muscle along;
fixed by collision, the muscle hangs back behind the femur. The last picture has taut paths. In the paper the
muscle is also drawn into the joint; the phantom's iliacus keeps clear of the femoral head.
"""

import numpy as np
import pyvista as pv

from vtkmuscle import RigidMotion, phantoms
from vtkmuscle.filters import FixedPointDetector
from vtkmuscle.pipelines import deform

hip = phantoms.hip()
motion = RigidMotion(hip.motion.times[:21], {"femur": hip.motion.transforms["femur"][:21]})
published = {"deformer": "pbd", "quality": "published", "iterations": 5}
cases = {
    "collision": ("collision", published),
    "attachment": ("attachment", published),
    "attachment, no push": ("attachment", {**published, "bone_push": "off"}),
    "defaults": ("attachment", {}),
}
plotter = pv.Plotter(shape=(1, 4), window_size=(1200, 600))
for column, (title, (method, settings)) in enumerate(cases.items()):
    detector = FixedPointDetector(method=method)
    muscle = detector.apply(hip.muscles["iliacus"], hip.bones, hip.attachments["iliacus"])
    deformer = deform(muscle, hip.bones, motion, fixing=None, measure_shape=True, **settings)
    deformed = pv.wrap(deformer.update(time=40.0).output)
    stretch = deformed.field_data["EdgeStretchMax"][0]
    volume = deformed.field_data["VolumeRatio"][0]
    print(f"{title}: longest edge {stretch:.1f} times its length at rest, volume {100 * volume:.2f} %")
    plotter.subplot(0, column)
    plotter.add_mesh(deformed, color="#b06060", scalars=None)
    plotter.add_points(deformed.points[np.array(deformed["FixedTo"]) >= 0], color="#0072b2", point_size=4)
    plotter.add_mesh(pv.wrap(deformer.bones.output), color="#efe6d0", opacity=0.4)
    plotter.add_text(title, font_size=8)
    plotter.camera_position = [(300, -300, 0), (-10, -10, 0), (0, 0, 1)]
plotter.show()
