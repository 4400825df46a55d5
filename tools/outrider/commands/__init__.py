"""Definitions of the commands of ``outrider``: their options, and the module that runs each.

Each command imports its module only when it runs, so that ``--help`` is quick.
"""
