"""Certified separation: takes the neighbours' committed plans, gives a plan that keeps clear of them.

Both sides hold the committed plans, with moving planes between them. A vehicle replans only with the plans of
all vehicles that it could meet.
"""
