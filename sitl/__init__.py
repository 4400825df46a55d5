"""An emulated autopilot with its vehicle: bytes in, bytes out, nothing else.

    bytes → codec → reception → orders   → commander → guidance → vehicle → sensors → telemetry → codec →
    bytes
                                steering →    ╵            ╵         ╵
                  who is meant, what it means │  mode, or  │  the    │  controller → allocation → rotors →
                  body
                                                 set-point    reference

``node.Autopilot`` is the whole of it. ``flavours`` holds what ArduPilot and PX4 do differently, ``shaper``
makes every reference flyable, ``origin`` turns the vehicle's own frame into the site's, ``pipeline`` is the
compiled vehicle.
"""
