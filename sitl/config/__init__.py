"""Settings of an emulated autopilot: they take plain values and give checked, frozen models."""
