"""Names that users of other libraries may try, and what to write instead."""

from __future__ import annotations

from difflib import get_close_matches
from os import PathLike
from typing import TYPE_CHECKING, Any, Self

_READ = "vtkmuscle.Scene.load(path) reads a scene"
_RESULTS = "vtkmuscle.Result.load(folder) reads the results of a run"
_ARCHITECTURE = "result.architecture() is a table of it"
_EXPORT = "`vtkmuscle export` writes models of OpenSim and MuJoCo"
_FOLDER = "scene.run(folder) writes all of a run, result.to_csv(folder) its tables"

#: By module or class: a name, and what to write instead.
GUESSES: dict[str, dict[str, str]] = {
    "vtkmuscle": {
        **dict.fromkeys(("load", "read", "open", "read_scene", "load_scene"), _READ),
        **dict.fromkeys(("load_result", "read_result", "read_results"), _RESULTS),
        **dict.fromkeys(("run_scene", "solve"), "Scene.load(path).run(folder) runs a scene"),
        "plot": "scene.plot() and result.plot() show a scene and results",
        "examples": "vtkmuscle.phantoms has bodies to try things on, and `vtkmuscle fetch` public data",
        "datasets": "vtkmuscle.phantoms has bodies to try things on, and `vtkmuscle fetch` public data",
        "Attachment": "vtkmuscle.AttachmentArea is where a muscle is attached",
        "Motion": "vtkmuscle.RigidMotion moves bones, vtkmuscle.hinge(...) makes one",
    },
    "Scene": {
        **dict.fromkeys(("from_file", "read", "open", "from_toml"), "Scene.load(path) reads a scene.toml"),
        "from_opensim": "`[motion] model` of a scene.toml takes an .osim; Scene.load(path) reads it",
        "from_meshes": "Scene(name, bones, muscles, motion) takes meshes, and vtkmuscle.Muscle(mesh, areas)",
        "write": "scene.save(folder) writes it",
        "solve": "scene.run(folder) runs it",
        "muscle_names": "list(scene.muscles) are they",
        "names": "list(scene.muscles) are they",
        "show": "scene.plot() shows it",
    },
    "Result": {
        **dict.fromkeys(("from_file", "read", "open"), "Result.load(folder) reads the results of a run"),
        **dict.fromkeys(("save", "write", "to_folder"), _FOLDER),
        **dict.fromkeys(("export", "to_opensim", "to_mujoco", "write_opensim"), _EXPORT),
        **dict.fromkeys(("pcsa", "pennation", "volume", "volumes"), _ARCHITECTURE),
        "names": "result.muscle_names are they",
        "show": "result.plot() shows it",
        "animate": "result.movie('muscles.gif') writes a film",
        "fibre_length": "result.fibre_lengths has them by muscle",
        "length": "result.lengths has them by muscle",
        "moment_arm": "result.moment_arms() has them by muscle and coordinate",
        "strain": "result.fibres(name, frame=k) has Strain by fibre",
        "bone": "result.bones(frame=k) are all of them, by name",
        "to_pandas": "result.to_frame(), and to_frame() of any table",
    },
    "Table": {
        **dict.fromkeys(("to_pandas", "df", "as_frame"), "table.to_frame() is a DataFrame"),
        **dict.fromkeys(("write", "save"), "table.to_csv(path) writes it"),
        "columns": "list(table) are they",
        "query": "table.where(muscle='iliacus', frame=3) are the rows of these values",
    },
}


def no_attribute(kind: str, name: str) -> AttributeError:
    """Return the error for an unknown name of ``"vtkmuscle"`` or of a class, with a hint if there is one."""
    known = GUESSES.get(kind, {})
    near = get_close_matches(name, known, n=1, cutoff=0.8)
    hint = f"; {known[near[0]]}" if near else ""
    what = "module" if kind == "vtkmuscle" else "object"
    subject = f"{what} {kind!r}" if kind == "vtkmuscle" else f"{kind!r} {what}"
    return AttributeError(f"{subject} has no attribute {name!r}{hint}")


class ClassWithHints(type):
    """A class that gives a hint for names that it does not have."""

    if not TYPE_CHECKING:  # which knows the names

        def __getattr__(cls, name: str) -> Any:
            raise no_attribute(cls.__name__, name)


class WithHints(metaclass=ClassWithHints):
    """A base class with hints for unknown names, on the class and its objects, and for a path as argument."""

    def __new__(cls, *arguments: Any, **fields: Any) -> Self:
        """Refuse a path, and name the method that reads it."""
        if len(arguments) == 1 and not fields and isinstance(arguments[0], str | PathLike):
            name, path = cls.__name__, str(arguments[0])
            raise TypeError(f"{name} takes no path; {name}.load({path!r}) reads a file or folder")
        return super().__new__(cls)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise no_attribute(type(self).__name__, name)
