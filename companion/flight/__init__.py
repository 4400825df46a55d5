"""Takes autopilot messages, operator commands and plans; gives commands, set-points and health reports."""
