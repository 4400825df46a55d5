"""Certified separation: takes the neighbours' committed plans, gives a plan that keeps clear of them.

Of each pair of vehicles, both hold the two committed plans and compute the same moving planes between them. A
vehicle replans only if it holds the plans of all vehicles that it could meet.
"""
