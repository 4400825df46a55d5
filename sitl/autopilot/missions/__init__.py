"""Missions, fences and rally points: held, sent up and down, and the mission flown.

messages → transfer → plans → itinerary → guidance. Fences are watched by ``sitl.autopilot.failsafes``; their
return points, and rally points, are kept and given back and change no flight.
"""
