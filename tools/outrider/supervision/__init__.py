"""Supervision of a companion: takes its datagrams, inhibits the take-off, and gives a hold on exit."""
