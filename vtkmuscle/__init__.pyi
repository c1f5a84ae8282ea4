from . import filters as filters, phantoms as phantoms, pipelines as pipelines, plotting as plotting
from .comparison import Comparison as Comparison, compare as compare
from .core.errors import InputError as InputError
from .core.motion.rigid import RigidMotion as RigidMotion, hinge as hinge
from .data.attachments import AttachmentArea as AttachmentArea
from .installation import selftest as selftest
from .labels.page import from_labels as from_labels, init as init
from .opensim.checking import check as check
from .opensim.from_run import export as export
from .public_data import fetch as fetch
from .run.result import MuscleResult as MuscleResult, Result as Result
from .run.table import MomentArmTable as MomentArmTable, Table as Table
from .scene.data import Muscle as Muscle, SceneError as SceneError
from .scenes import Scene as Scene
from .studies import cohort as cohort, vary as vary
from .tradeoffs import Tradeoff as Tradeoff, tradeoff as tradeoff

__version__: str
