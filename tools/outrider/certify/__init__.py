"""Whether a run kept its promise, from the plans on the wire alone, whoever made them and however:

    directory → reading → evidence → histories (each vehicle's plans) → pairs (of one epoch) → verdict

Nothing here knows how plans are made.
"""
