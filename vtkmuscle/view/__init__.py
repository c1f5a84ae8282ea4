"""The viewer: a run's results, or a scene that is solved as its slider moves, in a browser."""

from vtkmuscle.view.app import SceneDisplay, make_app, view

__all__ = ["SceneDisplay", "make_app", "view"]
