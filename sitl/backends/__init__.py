"""What moves the vehicle: our own integrator, or JSBSim.

    reference ─→ own:    controller → allocation → rotors → body → ground        (``sitl.vehicle``, compiled)
             └─→ jsbsim: controller → allocation ─→ JSBSim: motors → rotors → body → ground ─→ measured
                            ↑  jsbsim_pilot            jsbsim_engine, the file of jsbsim_model     │
                            └────────────────────────── state row ←────────────────────────────────┘

``physics`` says what the rest of the autopilot needs of either, ``selection`` makes one of them. Controller,
allocation and observer are the same code in both; all that moves is JSBSim's own, on a turning Earth.
"""
