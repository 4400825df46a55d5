"""Parts of the backup node, which flies the committed plan of a silent companion.

links → announced plans → what set-points add → (set-point)
                        → last farewell
"""
