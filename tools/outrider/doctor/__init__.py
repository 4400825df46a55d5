"""Examination of a vehicle: takes frames of a link or a log, returns what may prevent or endanger an escort.

The steps are frames → ``hearing`` (senders, messages, rates, last reception) → checks (findings) → verdict →
``page``, or JSON.

The examination is pure: times and frames go in, findings come out. On a live link ``consultation`` also sends
a few requests that change nothing; a log is read to its end without waiting.
"""
