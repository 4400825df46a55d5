"""The commands of ``outrider``: what each takes and is called, and nothing else.

Heavy imports wait until one of them needs them.
"""
