"""An emulated autopilot with its vehicle: bytes in, bytes out, nothing else.

    bytes → codec → reception ─→ orders ──→ commander (armed? which mode?) ─┐
                        └──────→ steering (a set-point?) ───────────────────┴→ guidance → shaper
                                                                                             │ reference
    bytes ← codec ← telemetry ← sensors ← body ← rotors ← allocation ← controller ←──────────┘

``node.Autopilot`` is the whole of it. ``flavours`` holds what ArduPilot and PX4 do differently, ``shaper``
makes every reference flyable, ``origin`` turns the vehicle's own frame into the site's, ``pipeline`` is the
compiled lower row from controller to body.
"""
