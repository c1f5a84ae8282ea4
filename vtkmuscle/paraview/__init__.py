"""The filters in ParaView: a plugin whose proxies are made from what the filters declare.

``proxies`` says how a declared parameter is shown and writes a filter's XML, ``shells`` gives a filter the
setters that ParaView calls, and a source of scenes, ``plugins`` is the folder that ParaView loads, and
``environment`` finds what has to be set for that. Nothing here imports PyVista, and nothing but the plugin
file itself imports ParaView.
"""
