"""Planning: takes the view and the phase of flight, gives the horizon that is flown and its set-points."""
