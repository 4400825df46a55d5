"""Avoidance by the paper's field: takes state, aim and obstacles, gives a plan that solves the DQMPC."""
