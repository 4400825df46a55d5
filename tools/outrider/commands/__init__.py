"""Definitions of the commands of ``outrider``: their options, and the module that runs each.

Heavy imports wait until a command needs them.
"""
