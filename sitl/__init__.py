"""An emulated autopilot with its vehicle: bytes in, bytes out, nothing else.

    bytes → codec → reception ─→ orders ──→ commander (armed? which mode?) ─┐
                        └──────→ steering (a set-point?) ───────────────────┴→ guidance → shaper
                                                                                             │ reference
    bytes ← codec ← telemetry ← sensors ← body ← rotors ← allocation ← controller ←──────────┘

``node.Autopilot`` is the whole of it; ``plant`` is the lower row with its air (``weather``, ``turbulence``)
and what is believed of it (``sensors`` with their ``profiles``, ``positioning``). ``flavours`` holds what
ArduPilot and PX4 do differently, ``shaper`` makes every reference flyable, ``course`` shifts it by the
estimate's error, ``origin`` turns the vehicle's own frame into the site's. ``pipeline`` is the compiled part
from controller to body, with ``observer`` between them; ``lanes`` let the same kernels run on eight vehicles
at once (``batch``). ``backends`` can put JSBSim in the place of all from rotors to body.
"""
