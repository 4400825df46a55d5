"""Missions, fences and rally points: storage, transfer over MAVLink, and flight of the mission.

The flow is messages → transfer → plans → itinerary → guidance. ``sitl.autopilot.failsafes`` monitors fences.
Their return points, and rally points, are stored and returned but change no flight.
"""
