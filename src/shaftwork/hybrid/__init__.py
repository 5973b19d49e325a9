"""Hybrid motions: smooth phases, in each of which every part keeps its mode, and the events between them.

An event is the instant at which a guard of the modes rises through zero: the engine locates it, and the event iteration
changes the mode whose guard is exceeded most, then the next one, until no guard is exceeded. With each change all that
is stored goes over to the equations of the new modes, by an impact where something rigid closes with a speed, and with
these equations the engine goes on.

    guards              modes.mode_machines       what changes its mode, and the guards that end its modes
    location            hybrid_run                the engine runs to the next guard that is met
                        in_place_events           where only numbers change, it goes on without a stop
    event iteration     event_iteration           modes change one after another until they are consistent
                        hybrid_state              modes and states at an instant, and which guards are exceeded
                        commutation               diodes that take over what a switch would cut off
    state transfer      phases.HybridTransfer            what is stored goes over to other modes
    impact              impacts.impacts           speeds that jump where parts meet
                        impacts.collisions        the complementarity problem of their impulses
                        impacts.impulses          impulses on their way through gears that rub
    next equations      modes.mode_equations      the equations and guards of a combination of modes
                        modes.reactions, joints   one set of equations for all that hold and slip
                        phases                    all of them, and their engines

`starts` says in which modes a motion begins, `hybrid_solution` reads it, `phased_model` is what a user calls,
`named_phases` finds a phase by its name, and `waves.hybrid_waves` joins travelling waves to a motion.
"""
