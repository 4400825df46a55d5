"""Missions, fences and rally points: storage, transfer over MAVLink, and flight of the mission.

The flow is messages → transfer → plans → itinerary → guidance. ``sitl.autopilot.failsafes`` monitors fences.
The return points of fences, and rally points, can be uploaded and downloaded, but have no effect on a flight.
"""
