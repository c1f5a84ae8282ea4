from .drawing import can_render as can_render
from .figures import (
    plot_lengths as plot_lengths,
    plot_moment_arms as plot_moment_arms,
)
from .plotters import (
    make_plotter as make_plotter,
    show_time as show_time,
)
from .studio import Studio as Studio, strain_colours as strain_colours
from .views import MuscleFrame as MuscleFrame, View as View, choose_view as choose_view
