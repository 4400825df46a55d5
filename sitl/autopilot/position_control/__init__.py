"""Position controllers of the firmwares, each on the airframe of its own simulator: set-point in, motion out.

``sitl.config.gains`` holds the parameters, ``ardupilot`` and ``px4`` the controllers, ``airframe`` the point
mass with drag and attitude lag that they control. The structure of each controller follows the firmware's
published sources (ArduCopter 4.6.3, PX4 1.16.1); ``tools/benchmarks/response.py`` compares them with recorded
flights.
"""
