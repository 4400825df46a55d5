"""Generator of the reference pages in docs/: takes the public names and the schemas, gives Markdown.

``python -m reference`` writes them; a test holds them up to date. Not part of the wheel.
"""
