"""The air: it takes time and the vehicle's motion and gives wind, gusts and turbulence."""
