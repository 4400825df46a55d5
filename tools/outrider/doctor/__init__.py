"""What is at the other end of a link, and what an escort misses there:

    frames → hearing (who says what, how often, last) → checks (a finding each) → verdict → page, or JSON

The examination is pure: time and frames come in, findings go out. On a live link ``consultation`` asks a few
polite questions as well; a log is read at once.
"""
