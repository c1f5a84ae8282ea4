"""The viewer: a run's results, or a scene that is solved as its slider moves, in a browser."""

from vtkmuscle.view.app import make_app, view
from vtkmuscle.view.solving import SceneDisplay

__all__ = ["SceneDisplay", "make_app", "view"]
