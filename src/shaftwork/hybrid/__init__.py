"""Hybrid motions: smooth phases, in each of which every part keeps its mode, and the events between them.

An event is the instant at which a guard, an expression that ends a mode, rises through zero: the mode whose guard is
exceeded most changes, what is stored goes over to the equations of the new modes, with an impact where something
closes, and so on until no guard is exceeded any more. Where one change in the same equations does, it is made while the
engine runs; else the engine begins anew.

    mode_machines, mode_guards   what changes its mode, and the guards that end its modes
    mode_equations, phases       the equations of a combination of modes; all of them, and their engines
    hybrid_state, regimes        modes and states at an instant, and how they go over to other modes
    exceeded_guards              which guards end modes at an instant
    event_iteration              modes change one after another until they are consistent
    in_place_events              the short way where only numbers change
    impacts                      speeds that jump: `impact_contacts` take part, `collisions` solves the complementarity
                                 problem of their impulses, `impulses` follows these through gears that rub
    commutation                  diodes that take over what a switch would cut off
    starts, hybrid_run, hybrid_solution   how a motion begins, goes on, and is read
    phased_model                 what a user calls

Beside these, `reactions` holds many frictions in one set of equations, `resting` has the laws of what cannot move,
`named_phases` finds a phase by its name, and `waves.hybrid_waves` joins travelling waves to a motion.
"""
