"""The commands of ``outrider``: what each takes, and whom it asks.

Heavy imports wait until one of them needs them.
"""
