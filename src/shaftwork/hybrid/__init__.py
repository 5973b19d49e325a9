"""Hybrid motions: smooth phases, in each of which every part keeps its mode, and the events between them.

How an event is handled:

1. An engine integrates the equations of the modes, `modes.mode_equations`, until one of their guards rises through
   zero: `hybrid_run`, and `integrate.guards` or `codegen.taylor.heyoka` for the instant.
2. Where the same equations go on with other numbers, heyoka goes on past the guard without a stop: `in_place_events`.
   Other engines stop at every guard.
3. Where an engine stops, `event_iteration` makes the transition of the guard that was met, and after it that of the
   guard that is then farthest beyond its limit, `hybrid_state`; diodes and freewheels take over what a transition would
   cut off, `commutation`.
4. All that is stored goes over to the equations of the new modes, `hybrid_transfer` and `codegen.state_transfer`, which
   `equation_sets` makes when a motion first needs them.
5. Where something rigid closes with a speed, an impact comes first and may throw it back: `impacts.impacts`.
6. Steps 3 to 5 repeat until every guard is within its limit, or on it and about to fall, `consistency`, and the engine
   goes on.

Where what is:

    modes and guards    modes.mode_machines             parts with their modes, and the guards that end these
    mode equations      modes.mode_equations            the equations and guards of a combination of modes
                        modes.reactions, modes.joints   one set of equations for all that hold and slip
                        equation_sets                   all sets of equations of a network, and their engines
    start               modes.starts                    in which modes a motion may start, or go on from another one
    location            hybrid_run                      runs an engine from one stop to the next
                        integrate.guards                where a step of scipy, SUNDIALS or a wave meets a guard
                        codegen.taylor.heyoka           guards as events of the Taylor series
    in-place event      in_place_events                 where only numbers in the equations change, without a stop
    event iteration     event_iteration                 one transition after another until the modes are consistent
                        consistency                     the rule that tells whether a guard allows a mode to go on
                        hybrid_state                    modes and states at an instant, and which guards are exceeded
                        commutation                     diodes that take over what a switch would cut off
    state transfer      hybrid_transfer                 from one combination of modes to another
                        codegen.state_transfer          the states of new equations from all that is stored
    impact              impacts.impacts                 speeds that jump where parts meet
                        impacts.impact_contacts         what touches, and which of it an impact takes
                        impacts.collisions              the complementarity problem of their impulses
                        impacts.impulses                impulses on their way through gears that rub

A `Regime` is a combination of modes with its equations and the parameters of a run, a `HybridState` a regime with
states. `hybrid_model` is what a user calls, `hybrid_solution` reads a motion, `named_phases` finds a phase by its name,
`waves.hybrid_waves` joins travelling waves to a motion and `sweep.hybrid_ensemble` takes many variants side by side
through their events. docs/glossary.md has the words.
"""
