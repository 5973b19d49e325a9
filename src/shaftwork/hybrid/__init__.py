"""Hybrid motions: smooth phases, in each of which every part keeps its mode, and the events between them.

How an event is handled: an engine integrates the equations of the modes until it locates the instant at which one of
their guards rises through zero. There the event iteration changes the mode whose guard is farthest beyond zero, and
what is stored goes over to the equations of the new modes, by an impact where something rigid closes with a speed;
this repeats until every guard is within its limit or about to fall, and the engine goes on in these equations.

    modes and guards    modes.mode_machines             parts with their modes, and the guards that end these
    mode equations      modes.mode_equations            the equations and guards of a combination of modes
                        modes.reactions, modes.joints   one set of equations for all that hold and slip
                        equation_sets                   all sets of equations of a network, and their engines
    start               modes.starts                    in which modes a motion may start, or go on from another one
    location            hybrid_run                      runs an engine from one stop to the next
                        integrate.guards                where a step of scipy, SUNDIALS or a wave meets a guard
                        codegen.taylor.heyoka           guards as events of the Taylor series
    event iteration     event_iteration                 modes change one after another until they are consistent
                        consistency                     the rule that tells whether a guard allows a mode to go on
                        hybrid_state                    modes and states at an instant, and which guards are exceeded
                        commutation                     diodes that take over what a switch would cut off
    state transfer      hybrid_transfer                 from one combination of modes to another
                        codegen.state_transfer          the states of new equations from all that is stored
    impact              impacts.impacts                 speeds that jump where parts meet
                        impacts.collisions              the complementarity problem of their impulses
                        impacts.impulses                impulses on their way through gears that rub
    in-place event      in_place_events                 where only numbers in the equations change, without a stop

A `Regime` is a combination of modes with its equations and the parameters of a run, a `HybridState` a regime with
states. `hybrid_model` is what a user calls, `hybrid_solution` reads a motion, `named_phases` finds a phase by its name,
`waves.hybrid_waves` joins travelling waves to a motion and `sweep.hybrid_ensemble` takes many variants side by side
through their events.
"""
