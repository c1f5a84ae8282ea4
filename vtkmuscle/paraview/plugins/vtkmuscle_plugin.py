"""The plugin file of ParaView.

ParaView loads the file by PV_PLUGIN_PATH, or by Tools, Manage Plugins, Load New, and searches proxies only
in the plugin's module.
"""

import sys

from paraview.util.vtkAlgorithm import smhint, smproperty, smproxy

try:
    from vtkmuscle import __version__
    from vtkmuscle.paraview.proxies import proxy_hints, proxy_parts, spaced
    from vtkmuscle.paraview.shells import all_kinds, shell_of
except ImportError as error:
    # Not an ImportError again: ParaView takes that for a Python of old, and says something else.
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    raise RuntimeError(
        f"vtkmuscle cannot be imported here ({error}). ParaView needs vtkmuscle, numba, numpy, scipy, "
        f"lazy-loader, robust-laplacian, pydantic and tomli-w in PYTHONPATH, for its Python {version}, "
        "without a second VTK; run 'vtkmuscle paraview-path' and see the documentation, 'In ParaView'"
    ) from error

paraview_plugin_name = "Muscle"
paraview_plugin_version = __version__

for _kind in all_kinds():
    _shell = shell_of(_kind, __name__)
    for _part in proxy_parts(_kind):
        _shell = smproperty.xml(_part)(_shell)
    for _hint in proxy_hints(_kind):
        _shell = smhint.xml(_hint)(_shell)
    _decorate = smproxy.filter if _kind.input_ports else smproxy.source
    globals()[_kind.__name__] = _decorate(
        name=_kind.__name__, label=spaced(_kind.__name__), support_reload=False
    )(_shell)
