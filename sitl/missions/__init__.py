"""Missions, fences and rally points: held, sent up and down, and the mission flown.

messages → transfer → plans → itinerary → guidance. Fences and rally points are kept and given back; they
change no flight.
"""
