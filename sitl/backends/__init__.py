"""Physics backends: they take references and wind and give the vehicle's motion, by our integrator or JSBSim.

    reference ─→ own:    controller → allocation → rotors → body → ground        (``sitl.vehicle``, compiled)
             └─→ jsbsim: controller → allocation ─→ JSBSim: motors → rotors → body → ground ─→ measured
                            ↑  jsbsim_pilot            jsbsim_engine, the file of jsbsim_model     │
                            └────────────────────────── state row ←────────────────────────────────┘

``physics`` defines the interface to the rest of the autopilot, ``selection`` makes one of the backends.
Controller, allocation and observer are the same code in both; JSBSim simulates all motion itself, on a
rotating Earth.
"""
