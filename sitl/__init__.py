"""Emulated autopilot with its vehicle: it takes MAVLink bytes and returns MAVLink bytes.

    bytes → codec → reception ─→ orders ──→ commander (armed? which mode?) ─┐
                        └──────→ steering (a set-point?) ───────────────────┴→ guidance → shaper
                                                                                             │ reference
    bytes ← codec ← telemetry ← sensors ← body ← rotors ← allocation ← controller ←──────────┘

``node.Autopilot`` is the whole: ``autopilot.endpoint`` has the codec, ``communication`` is all that handles
messages and telemetry, ``autopilot.aircraft`` is all that flies. ``autopilot.plant`` is the lower row from
``sensors`` to ``controller``, with the air (``environment.weather``, ``environment.turbulence``) and the
estimate (``estimation.sensors`` with ``estimation.profiles`` and ``estimation.gps_faults``).
``autopilot.firmware`` holds the differences between ArduPilot and PX4, ``autopilot.shaper`` bounds
references, ``autopilot.course`` shifts them by the estimate's error, ``values.origin`` transforms the
vehicle's own frame into the site's. ``vehicle.pipeline`` is the compiled part from controller to body, with
``vehicle.observer`` between them; ``vehicle.simd`` runs the same kernels on eight vehicles at once
(``vehicle.batch``). ``backends`` can replace everything from rotors to body by JSBSim.
"""
