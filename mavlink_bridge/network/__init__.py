"""Simulated network: takes datagrams from nodes and delivers them with seeded faults."""
