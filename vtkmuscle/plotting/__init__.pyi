from .figures import (
    plot_lengths as plot_lengths,
    plot_muscle as plot_muscle,
    plot_rest_pose as plot_rest_pose,
)
from .moment_arms import plot_moment_arms as plot_moment_arms
from .movie import check_movie as check_movie, write_movie as write_movie
from .moving import MovingScene as MovingScene, Pose as Pose
from .preflight import can_render as can_render
from .studio import Studio as Studio
from .surfaces import make_plotter as make_plotter
from .times import add_time_slider as add_time_slider, show_time as show_time
from .views import View as View, choose_view as choose_view, framed as framed
