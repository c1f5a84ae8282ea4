"""The filters as a ParaView plugin.

``proxies`` writes a filter's XML, ``shells`` has the setters that ParaView calls and a source of scenes,
``plugins`` is the folder that ParaView loads, and ``environment`` finds the necessary variables. No module
imports PyVista, and only the plugin file imports ParaView.
"""
